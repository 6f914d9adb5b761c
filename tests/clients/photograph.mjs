// three.js in headless Chromium: photographs .glb files as a stock client shows them.
// stdin: {size, fov, jobs: [{file, center, radius, supersample, mipmaps,
//         views: [{direction, distance, sun}], out: [PNG path, one per view]}, ...]}
//   size: pixels a side; supersample: times larger, to be averaged by the reader. distance: radii.
//   mipmaps: false samples textures as they are, which a truth needs.
//   sun: where from, [0.5, 1, 0.7] where it is left out.
// stdout: one JSON object per line and job, {file, triangles, texels, complaints}.
// 4x multisampling where nothing is supersampled, a sun and a sky, no tone mapping.
import fs from 'node:fs';
import {inBrowser} from './browser.mjs';
import {readInput} from './packages.mjs';

const {size, fov, jobs} = await readInput();

const script = `
import * as THREE from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';

const renderer = new THREE.WebGLRenderer(
  {alpha: true, antialias: true, preserveDrawingBuffer: true});
renderer.setPixelRatio(1);
renderer.setClearColor(0x000000, 0);
const sun = new THREE.DirectionalLight(0xffffff, 2.2);
let scene, camera, middle, scale;

// A truth is sampled finely instead: mips lose the leaves of a tree in the distance, even so.
const unmipped = (model) => model.traverse(({material}) => {
  for (const texture of Object.values(material ?? {})) {
    if (!texture?.isTexture) continue;
    texture.minFilter = THREE.LinearFilter;
    texture.generateMipmaps = false;
  }
});

window.open3 = async ({url, center, radius, mipmaps}) => {
  const {scene: model} = await new GLTFLoader().loadAsync(url);
  if (!mipmaps) unmipped(model);
  scene = new THREE.Scene();
  scene.add(model, sun, new THREE.HemisphereLight(0xffffff, 0x888888, 1.2));
  middle = new THREE.Vector3(...center);
  scale = radius;
  camera = new THREE.PerspectiveCamera(${fov}, 1, radius / 100, radius * 100);
  let triangles = 0, texels = 0;
  const seen = new Set();
  model.traverse((node) => {
    if (!node.isMesh) return;
    triangles += node.geometry.index.count / 3;
    for (const value of Object.values(node.material)) {
      if (!value?.isTexture || seen.has(value.source)) continue;
      seen.add(value.source);
      texels += value.image.width * value.image.height;
    }
  });
  return {triangles, texels};
};

window.shoot = ({direction, distance, sun: from = [0.5, 1, 0.7]}, supersample) => {
  sun.position.set(...from);
  renderer.setSize(${size} * supersample, ${size} * supersample);
  camera.position.copy(middle)
    .addScaledVector(new THREE.Vector3(...direction).normalize(), distance * scale);
  camera.lookAt(middle);
  renderer.render(scene, camera);
  return renderer.domElement.toDataURL('image/png').split(',')[1];
};
window.ready = true;
`;

const files = jobs.map((job) => job.file);
await inBrowser(script, files, async (tab, complaints) => {
  for (const [index, {file, center, radius, supersample, mipmaps, views, out}] of jobs.entries()) {
    complaints.length = 0;
    const facts = await tab.evaluate(
      (job) => window.open3(job), {url: `/file/${index}`, center, radius, mipmaps});
    for (const [i, view] of views.entries()) {
      const png = await tab.evaluate((v, s) => window.shoot(v, s), view, supersample);
      fs.writeFileSync(out[i], Buffer.from(png, 'base64'));
    }
    console.log(JSON.stringify({file, ...facts, complaints}));
  }
});
