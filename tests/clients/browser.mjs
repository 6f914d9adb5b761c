// A page with three.js in headless Chromium, and files for it to load.
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import {fileURLToPath} from 'node:url';
import {folder, load} from './packages.mjs';

const page = `<!doctype html>
<script type="importmap">
  {"imports": {"three": "/packages/three/build/three.module.js",
               "three/addons/": "/packages/three/examples/jsm/",
               "3d-tiles-renderer/three": "/packages/3d-tiles-renderer/build/index.three.js",
               "vegtool/": "/ours/"}}
</script>
<script type="module" src="/page.js"></script>`;
const ours = fileURLToPath(new URL('../../docs/clients', import.meta.url));
const types = {
  '.js': 'text/javascript', '.html': 'text/html', '.glb': 'model/gltf-binary',
  '.gltf': 'model/gltf+json', '.json': 'application/json', '.png': 'image/png',
};

// Opens a page that runs `script` (a module that sets window.ready) and serves files[i] at
// /file/i, and what is below it, where it is a folder, at /file/i/...; what docs/clients has can be
// imported from vegtool/. Calls work(tab, complaints,
// asked), with what the page complains of and the paths that the server is asked for, and closes
// everything. What is in folders may be kept by the browser, as a server of tiles allows it.
export async function inBrowser(script, files, work) {
  const asked = [];
  const server = http.createServer((request, response) => {
    const url = decodeURIComponent(request.url.split('?')[0]);
    const send = (type, body) => response.setHeader('content-type', type).end(body);
    asked.push(url);
    if (url === '/') return send('text/html', page);
    if (url === '/favicon.ico') return response.writeHead(204).end();
    if (url === '/page.js') return send('text/javascript', script);
    const [, index, below] = url.match(/^\/file\/(\d+)(\/.*)?$/) ?? [];
    const own = url.match(/^\/ours(\/.*)/)?.[1];
    const file = index
      ? path.join(files[index], below ?? '')
      : own ? path.join(ours, own) : path.join(folder, url.replace(/^\/packages\//, ''));
    if (below) response.setHeader('cache-control', 'max-age=3600');
    fs.readFile(file, (error, body) => {
      if (error) return response.writeHead(404).end();
      return send(types[path.extname(file)] || 'application/octet-stream', body);
    });
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));

  const profile = fs.mkdtempSync(path.join(os.tmpdir(), 'vegtool-chromium-'));
  const browser = await load('puppeteer-core').launch({
    executablePath: process.env.VEGTOOL_CHROMIUM,
    userDataDir: profile,
    protocolTimeout: 600_000,
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
    await work(tab, complaints, asked);
  } finally {
    await browser.close();
    server.close();
    fs.rmSync(profile, {recursive: true, force: true});
  }
}
