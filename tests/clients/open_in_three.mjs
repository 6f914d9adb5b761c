// three.js in headless Chromium: opens .glb files with GLTFLoader and draws them.
// stdin: {cells, cover, views: [[x, y, z], ...], jobs: [{file, center, radius, pixels}, ...]}
//   The picture is a square of cells * cells, each drawn with pixels * pixels pixels.
//   views: directions from the centre to the camera; center, radius: metres, what is in view.
// stdout: one JSON object per line and job,
//   {file, triangles, textures, complaints, silhouettes: [base64, one per view]}
//   or {file, error, complaints}. A silhouette is cells * cells bits, top row first, highest bit
//   first: 1 where at least the share `cover` of the cell's pixels is drawn.
// One browser and one page serve all jobs.
import {inBrowser} from './browser.mjs';
import {readInput} from './packages.mjs';

const {cells, cover, views, jobs} = await readInput();

const script = `
import * as THREE from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';

const cells = ${cells}, cover = ${cover}, views = ${JSON.stringify(views)};
const FOV = 30;
const renderer = new THREE.WebGLRenderer({alpha: true, antialias: false});
renderer.setPixelRatio(1);
renderer.setClearColor(0x000000, 0);

function silhouette(scene, direction, center, radius, pixels) {
  const size = cells * pixels;
  const target = new THREE.WebGLRenderTarget(size, size);
  const rgba = new Uint8Array(4 * size * size);
  const camera = new THREE.PerspectiveCamera(FOV, 1, radius / 100, radius * 10);
  const distance = radius / Math.sin(THREE.MathUtils.degToRad(FOV / 2));
  const away = new THREE.Vector3(...direction).normalize();
  if (Math.abs(away.y) > 0.99) camera.up.set(0, 0, -1);
  camera.position.copy(center).addScaledVector(away, distance);
  camera.lookAt(center);
  renderer.setRenderTarget(target);
  renderer.clear();
  renderer.render(scene, camera);
  renderer.readRenderTargetPixels(target, 0, 0, size, size, rgba);
  target.dispose();
  const drawn = new Uint32Array(cells * cells);
  for (let i = 0; i < size * size; i++) {
    const row = size - 1 - Math.floor(i / size);  // GL's first row is the lowest
    const cell = Math.floor(row / pixels) * cells + Math.floor(i % size / pixels);
    if (rgba[4 * i + 3] >= 128) drawn[cell] += 1;
  }
  const bits = new Uint8Array(cells * cells / 8);
  drawn.forEach((count, i) => {
    if (count >= cover * pixels * pixels) bits[i >> 3] |= 128 >> (i & 7);
  });
  return btoa(String.fromCharCode(...bits));
}

window.draw = async ({url, center, radius, pixels}) => {
  const {scene: model} = await new GLTFLoader().loadAsync(url);
  const scene = new THREE.Scene();
  scene.add(model, new THREE.HemisphereLight(0xffffff, 0x888888, 3));
  let triangles = 0;
  const textures = new Set();
  model.traverse((node) => {
    if (!node.isMesh) return;
    triangles += node.geometry.index.count / 3;
    for (const value of Object.values(node.material)) if (value?.isTexture) textures.add(value);
  });
  const middle = new THREE.Vector3(...center);
  const silhouettes = views.map((view) => silhouette(scene, view, middle, radius, pixels));
  model.traverse((node) => { if (node.isMesh) { node.geometry.dispose(); node.material.dispose(); } });
  for (const texture of textures) texture.dispose();
  return {triangles, textures: textures.size, silhouettes};
};
window.ready = true;
`;

const files = jobs.map((job) => job.file);
await inBrowser(script, files, async (tab, complaints) => {
  for (const [index, {file, ...camera}] of jobs.entries()) {
    complaints.length = 0;
    try {
      const drawn = await tab.evaluate((job) => window.draw(job), {
        url: `/file/${index}`, ...camera,
      });
      console.log(JSON.stringify({file, ...drawn, complaints}));
    } catch (error) {
      console.log(JSON.stringify({file, error: error.message, complaints}));
    }
  }
});
