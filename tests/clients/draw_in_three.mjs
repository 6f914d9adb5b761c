// three.js in headless Chromium: draws .glb files by given cameras, under a sun and a sky alone.
// stdin: {light: {sun, above, below}, jobs: [{file, stock, views: [{eye, target, up, fov,
//         full: [w, h], crop: [x, y, w, h], near, far, sun: [x, y, z], out}, ...]}, ...]}
//   light: strengths as factors of the albedo. sun: towards it. fov: degrees, of the full image,
//   of which a crop is drawn; pixels, from the upper left.
// stdout: one JSON object per line and job, {file, complaints}. The picture of a view is written to
//   the file `out`, as linear_light.mjs makes it.
// Materials become Lambert's; where `stock` is true they stay as three's own loader makes them.
import fs from 'node:fs';
import {inBrowser} from './browser.mjs';
import {inLinearLight} from './linear_light.mjs';
import {readInput} from './packages.mjs';

const {light, jobs} = await readInput();

const script = `
import * as THREE from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';

${inLinearLight(light)}
let scene;

window.open3 = async (url, stock) => {
  scene?.traverse((node) => {
    if (!node.isMesh) return;
    node.geometry.dispose();
    for (const map of ['map', 'normalMap']) node.material[map]?.dispose();
    node.material.dispose();
  });
  const {scene: model} = await new GLTFLoader().loadAsync(url);
  model.traverse((node) => {
    if (node.isMesh && !stock) node.material = lambert(node.material);
  });
  scene = new THREE.Scene();
  scene.add(model, sun, sky);
};

window.shoot = (view) => {
  const [x, y, width, height] = view.crop;
  const camera = new THREE.PerspectiveCamera(
    view.fov, view.full[0] / view.full[1], view.near, view.far);
  camera.setViewOffset(...view.full, x, y, width, height);
  camera.position.set(...view.eye);
  camera.up.set(...view.up);
  camera.lookAt(...view.target);
  return picture(scene, camera, view.sun, width, height);
};
window.ready = true;
`;

const files = jobs.map((job) => job.file);
await inBrowser(script, files, async (tab, complaints) => {
  for (const [index, {file, stock, views}] of jobs.entries()) {
    complaints.length = 0;
    await tab.evaluate((url, own) => window.open3(url, own), `/file/${index}`, stock ?? false);
    for (const view of views) {
      const pixels = await tab.evaluate((v) => window.shoot(v), view);
      fs.writeFileSync(view.out, Buffer.from(pixels, 'base64'));
    }
    console.log(JSON.stringify({file, complaints}));
  }
});
