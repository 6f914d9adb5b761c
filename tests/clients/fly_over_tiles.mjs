// 3d-tiles-renderer in headless Chromium: loads tilesets over HTTP and flies through them.
// stdin: {width, height, error, light: {sun, above, below}, visits: [{folder,
//         most, shares, stations: [{eye, target, fov, near, far, sun: [x, y, z], out}, ...]},
//         ...]}
//   error: pixels, of a tile that may be drawn, not its children. folder: with a tileset.json; what
//   it names is served from there. most: bytes that the client allows itself, of which it
//   then keeps none for what is out of sight; null: as it has it, 0.4 GB. shares: whether it has the plugin of docs/clients/shared_textures.js. Stations are flown to one after the other, and each waited at
//   until nothing more is loaded. light, fov, sun: as of draw_in_three.mjs, y up.
// stdout: one JSON object per visit,
//   {folder, stations: [{drawn, calls, refused, bytes, textures}, ...], failed, asked, complaints}
//   drawn: files of the tiles in the picture, from the folder. calls: to draw it. refused: tiles
//   for which the memory that the client allows itself was too full. bytes: of it, used. textures:
//   on the GPU. failed: [[file, message], ...]. asked: by file, how often the server was. The picture of a station is written
//   to `out`, as linear_light.mjs makes it.
import fs from 'node:fs';
import {inBrowser} from './browser.mjs';
import {inLinearLight} from './linear_light.mjs';
import {readInput} from './packages.mjs';

const {width, height, error, light: strengths, visits} = await readInput();

const script = `
import * as THREE from 'three';
import {TilesRenderer} from '3d-tiles-renderer/three';
import {SharedTextures} from 'vegtool/shared_textures.js';

${inLinearLight(strengths)}
const width = ${width}, height = ${height};
const SETTLED = 3;  // updates without a change
let tiles, base, scene, failed, usual;

// of a tile's content, which may be in a tileset that another one refers to
const fileOf = (url) => new URL(url, location.href).href.slice(base.length);
const contentOf = (tile) => new URL(tile.content.uri, tile.internal.basePath + '/');

window.visit = (folder, most, shares) => {
  tiles?.dispose();
  base = new URL(folder, location.href).href;
  failed = [];
  tiles = new TilesRenderer(folder + 'tileset.json');
  tiles.errorTarget = ${error};
  const cache = tiles.lruCache;  // which all tilesets of a page have
  const {minBytesSize, maxBytesSize, unloadPercent} = cache;
  usual ??= {minBytesSize, maxBytesSize, unloadPercent};
  const narrow = {minBytesSize: 0, maxBytesSize: most, unloadPercent: 1};
  Object.assign(cache, most ? narrow : usual);
  if (shares) tiles.registerPlugin(new SharedTextures());
  tiles.addEventListener('load-error', ({url, error}) => failed.push([fileOf(url), error.message]));
  tiles.addEventListener('load-model', ({scene: model}) => model.traverse((node) => {
    if (node.isMesh) node.material = lambert(node.material);
  }));
  tiles.group.rotation.x = -Math.PI / 2;  // from z up to y up
  scene = new THREE.Scene();
  scene.add(tiles.group, sun, sky);
};

window.station = async ({eye, target, fov, near, far, sun}) => {
  const camera = new THREE.PerspectiveCamera(fov, width / height, near, far);
  camera.position.set(...eye);
  camera.lookAt(...target);
  camera.updateMatrixWorld();
  tiles.group.updateMatrixWorld(true);
  tiles.setCamera(camera);
  tiles.setResolution(camera, width, height);
  for (let calm = 0; calm < SETTLED;) {
    tiles.update();
    const {queued, downloading, parsing} = tiles.stats;
    const known = tiles.root || failed.length;
    calm = known && !tiles.isLoading && !(queued + downloading + parsing) ? calm + 1 : 0;
    await new Promise((done) => setTimeout(done));
  }
  const pixels = picture(scene, camera, sun, width, height);
  const {calls} = renderer.info.render, {textures} = renderer.info.memory;
  const {refused} = tiles.stats, bytes = tiles.lruCache.cachedBytes;
  tiles.deleteCamera(camera);
  const drawn = [...tiles.visibleTiles].map((tile) => fileOf(contentOf(tile))).sort();
  return [{drawn, calls, refused, bytes, textures}, pixels];
};
window.told = () => failed;
window.ready = true;
`;

const folders = visits.map((visit) => visit.folder);
await inBrowser(script, folders, async (tab, complaints, asked) => {
  for (const [index, {folder, most, shares, stations}] of visits.entries()) {
    complaints.length = 0;
    asked.length = 0;
    const base = `/file/${index}/`, found = [];
    await tab.evaluate((...job) => window.visit(...job), base, most ?? null, shares ?? false);
    for (const {out, ...view} of stations) {
      const [state, pixels] = await tab.evaluate((v) => window.station(v), view);
      fs.writeFileSync(out, Buffer.from(pixels, 'base64'));
      found.push(state);
    }
    const counts = {};
    for (const url of asked.map((each) => each.slice(base.length))) {
      counts[url] = (counts[url] ?? 0) + 1;
    }
    const failed = await tab.evaluate(() => window.told());
    const told = {folder, stations: found, failed, asked: counts, complaints};
    console.log(JSON.stringify(told));
  }
});
