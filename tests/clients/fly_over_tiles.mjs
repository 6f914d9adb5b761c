// 3d-tiles-renderer in headless Chromium: loads tilesets over HTTP and flies through them.
// stdin: {width, height, error, light: {sun, above, below}, visits: [{folder,
//         stations: [{eye, target, fov, near, far, sun: [x, y, z], out}, ...]}, ...]}
//   error: pixels, of a tile that may be drawn, not its children. folder: with a tileset.json; what
//   it names is served from there. Stations are flown to one after the other, and each waited at
//   until nothing more is loaded. light, fov, sun: as of draw_in_three.mjs, y up.
// stdout: one JSON object per visit,
//   {folder, stations: [{drawn, calls, refused}, ...], failed, asked, complaints}
//   drawn: files of the tiles in the picture, from the folder. calls: to draw it. refused: tiles
//   for which the memory that the client allows itself, 0.4 GB, was too full. failed: [[file,
//   message], ...]. asked: by file, how often the server was. The picture of a station is written
//   to `out`, as linear_light.mjs makes it.
import fs from 'node:fs';
import {inBrowser} from './browser.mjs';
import {inLinearLight} from './linear_light.mjs';
import {readInput} from './packages.mjs';

const {width, height, error, light: strengths, visits} = await readInput();

const script = `
import * as THREE from 'three';
import {TilesRenderer} from '3d-tiles-renderer/three';

${inLinearLight(strengths)}
const width = ${width}, height = ${height};
const SETTLED = 3;  // updates without a change
let tiles, base, scene, failed;

// of a tile's content, which may be in a tileset that another one refers to
const fileOf = (url) => new URL(url, location.href).href.slice(base.length);
const contentOf = (tile) => new URL(tile.content.uri, tile.internal.basePath + '/');

window.visit = (folder) => {
  tiles?.dispose();
  base = new URL(folder, location.href).href;
  failed = [];
  tiles = new TilesRenderer(folder + 'tileset.json');
  tiles.errorTarget = ${error};
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
  const {calls} = renderer.info.render, {refused} = tiles.stats;
  tiles.deleteCamera(camera);
  const drawn = [...tiles.visibleTiles].map((tile) => fileOf(contentOf(tile))).sort();
  return [{drawn, calls, refused}, pixels];
};
window.told = () => failed;
window.ready = true;
`;

const folders = visits.map((visit) => visit.folder);
await inBrowser(script, folders, async (tab, complaints, asked) => {
  for (const [index, {folder, stations}] of visits.entries()) {
    complaints.length = 0;
    asked.length = 0;
    const base = `/file/${index}/`, found = [];
    await tab.evaluate((url) => window.visit(url), base);
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
