// three.js in headless Chromium: opens .glb files with GLTFLoader and draws them.
// stdin: {cells, cover, views: [[x, y, z], ...], jobs: [{file, center, radius, pixels}, ...]}
//   The picture is a square of cells * cells, each drawn with pixels * pixels pixels.
//   views: directions from the centre to the camera; center, radius: metres, what is in view.
// stdout: one JSON object per line and job,
//   {file, triangles, textures, complaints, silhouettes: [base64, one per view]}
//   or {file, error, complaints}. A silhouette is cells * cells bits, top row first, highest bit
//   first: 1 where at least the share `cover` of the cell's pixels is drawn.
// One browser and one page serve all jobs.
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import {folder, load, readInput} from './packages.mjs';

const {cells, cover, views, jobs} = await readInput();
const puppeteer = load('puppeteer-core');

const page = `<!doctype html>
<script type="importmap">
  {"imports": {"three": "/packages/three/build/three.module.js",
               "three/addons/": "/packages/three/examples/jsm/"}}
</script>
<script type="module" src="/page.js"></script>`;

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

const types = {'.js': 'text/javascript', '.html': 'text/html', '.glb': 'model/gltf-binary'};
const server = http.createServer((request, response) => {
  const url = decodeURIComponent(request.url.split('?')[0]);
  const send = (type, body) => response.setHeader('content-type', type).end(body);
  if (url === '/') return send('text/html', page);
  if (url === '/favicon.ico') return response.writeHead(204).end();
  if (url === '/page.js') return send('text/javascript', script);
  const job = url.match(/^\/job\/(\d+)$/);
  const file = job ? jobs[job[1]].file : path.join(folder, url.replace(/^\/packages\//, ''));
  fs.readFile(file, (error, body) => {
    if (error) return response.writeHead(404).end();
    return send(types[path.extname(file)] || 'application/octet-stream', body);
  });
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));

const profile = fs.mkdtempSync(path.join(os.tmpdir(), 'vegtool-chromium-'));
const browser = await puppeteer.launch({
  executablePath: process.env.VEGTOOL_CHROMIUM,
  userDataDir: profile,
  protocolTimeout: 300_000,
  args: [
    '--no-sandbox', '--no-first-run', '--disable-quic', '--disable-sync',
    '--disable-background-networking', '--disable-component-update', '--disable-dev-shm-usage',
    '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
    '--ignore-gpu-blocklist',
  ],
});
try {
  const tab = await browser.newPage();
  const complaints = [];
  tab.on('pageerror', (error) => complaints.push(error.message));
  tab.on('console', (line) => {
    if (['error', 'warn'].includes(line.type())) complaints.push(line.text());
  });
  await tab.goto(`http://127.0.0.1:${server.address().port}/`);
  await tab.waitForFunction('window.ready', {timeout: 60_000});
  for (const [index, {file, ...camera}] of jobs.entries()) {
    complaints.length = 0;
    try {
      const drawn = await tab.evaluate((job) => window.draw(job), {
        url: `/job/${index}`, ...camera,
      });
      console.log(JSON.stringify({file, ...drawn, complaints}));
    } catch (error) {
      console.log(JSON.stringify({file, error: error.message, complaints}));
    }
  }
} finally {
  await browser.close();
  server.close();
  fs.rmSync(profile, {recursive: true, force: true});
}
