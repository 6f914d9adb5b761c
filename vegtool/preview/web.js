// Draws plants, each by the level that its manifest states for the distance.
"use strict";
(() => {
const COLORS = ["#6b7780", "#2a75c2", "#188562", "#a66f00", "#c94a1f", "#9a5bb0", "#23808d"];
const ANISOTROPY = 4; // as errors are measured
const STEEPEST = 89; // degrees: from straight above, up is nowhere
const STEP = 5, CLOSER = 1.1; // degrees and times, of one press of a key
const FROM = {azimuth: 30, elevation: 8}; // the first view
const AIR = 1.2; // times, of the picture over the plant
const TURN = 20; // degrees a second
const degrees = Math.PI / 180;

const byId = (id) => document.getElementById(id);
const {plants, light: usual} = JSON.parse(byId("data").textContent);
const canvas = byId("canvas");
const clamp = (low, value, high) => Math.min(Math.max(value, low), high);
const metres = (value) => `${value < 1000 ? value.toPrecision(3) : value.toFixed(0)} m`;
const colorOf = (level) => COLORS[level % COLORS.length];
// As vegtool states directions: azimuth from +z towards +x, elevation above the horizon, degrees.
const toward = (azimuth, elevation) => new THREE.Vector3().setFromSphericalCoords(
  1, (90 - elevation) * degrees, azimuth * degrees);

// ---- What is shown -------------------------------------------------------------------------

const view = {
  plant: 0, level: "auto", distance: 1, ...FROM,
  sunAzimuth: 0, sunElevation: 0, colored: false, wireframe: false, turning: false,
};
let models = []; // of each level of the plant: {scene, parts}; empty while they are loaded
let radius = 1, span = new THREE.Vector3(1, 1, 1), used = 0;

const renderer = startRenderer();
const world = new THREE.Scene();
const sun = new THREE.DirectionalLight(), sky = new THREE.HemisphereLight();
const camera = new THREE.PerspectiveCamera();
const stage = new THREE.Group(); // the plant, with its middle at the origin
world.add(sun, sky, stage);

function startRenderer() {
  const settings = {alpha: true, antialias: true};
  try {
    const context = canvas.getContext("webgl2", settings);
    const made = new THREE.WebGLRenderer({canvas, context, ...settings});
    made.outputEncoding = THREE.sRGBEncoding;
    made.setClearColor(0x000000, 0);
    return made;
  } catch (error) {
    complain("This browser draws no WebGL 2, which the levels need. Allow hardware acceleration, " +
             "or open the page in another browser.");
    throw error;
  }
}

function complain(text) {
  byId("trouble").textContent = text;
  byId("trouble").hidden = false;
}

// ---- Models --------------------------------------------------------------------------------

function bytesOf(number) {
  const text = atob(byId(`model-${number}`).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

async function loadLevel({model}) {
  const {scene} = await new Promise((done, failed) =>
    new THREE.GLTFLoader().parse(bytesOf(model), "", done, failed));
  const parts = [];
  scene.traverse((node) => {
    if (!node.isMesh) return;
    const own = node.material;
    for (const map of [own.map, own.normalMap, own.aoMap]) if (map) map.anisotropy = ANISOTROPY;
    parts.push({node, own, materials: {}});
  });
  return {scene, parts};
}

// Lambert's law in every pixel, as errors are measured: r140's own Lambert material is shaded at
// vertices alone, and knows no normal textures.
const NO_GLOSS = new THREE.DataTexture(new Uint8Array([0, 0, 0, 255]), 1, 1);
NO_GLOSS.needsUpdate = true;
const KEPT = ["map", "normalMap", "normalScale", "aoMap", "alphaTest", "side", "color",
              "vertexColors"];
function matt(own) {
  const made = new THREE.MeshPhongMaterial({specularMap: NO_GLOSS});
  for (const key of KEPT) if (own[key]) made[key] = own[key];
  return made;
}

const MATERIALS = {
  plain: (own) => own.isMeshBasicMaterial ? own : matt(own),
  colored: (own, level) => {
    const made = matt(own);
    made.color = own.color.clone().multiplyScalar(0.3); // some of the light stays
    made.emissive = new THREE.Color(colorOf(level)).convertSRGBToLinear().multiplyScalar(0.8);
    return made;
  },
  wireframe: (own, level) => new THREE.MeshBasicMaterial(
    {wireframe: true, color: new THREE.Color(colorOf(level)).convertSRGBToLinear()}),
};

function dress(level) {
  const style = view.wireframe ? "wireframe" : view.colored ? "colored" : "plain";
  for (const {node, own, materials} of models[level].parts) {
    node.material = materials[style] ??= MATERIALS[style](own, level);
  }
}

function dispose() {
  for (const {scene, parts} of models) {
    stage.remove(scene);
    for (const {node, own, materials} of parts) {
      node.geometry.dispose();
      for (const map of [own.map, own.normalMap, own.aoMap]) map?.dispose();
      for (const material of [own, ...Object.values(materials)]) material.dispose();
    }
  }
  models = [];
}

async function open(index) {
  const plant = plants[index];
  dispose();
  byId("shown").textContent = "Loading ...";
  const loaded = await Promise.all(plant.levels.map(loadLevel));
  if (view.plant !== index) return; // another was chosen meanwhile
  models = loaded;
  const bounds = new THREE.Box3().setFromObject(models[0].scene);
  const middle = bounds.getCenter(new THREE.Vector3());
  bounds.getSize(span);
  radius = span.length() / 2 || 1;
  stage.position.copy(middle).negate();
  stage.add(...models.map(({scene}) => scene));
  used = 0;
  describe();
  reset();
}

// ---- Levels by distance --------------------------------------------------------------------

// Of the canvas over that of the manifest; the field of view is the manifest's.
const pixelsPerRadian = (height, fov) => height / 2 / Math.tan(fov * degrees / 2);
function scale() {
  const plant = plants[view.plant];
  return pixelsPerRadian(canvas.height, camera.fov) /
    pixelsPerRadian(plant.image_height_px, plant.fov_y_deg);
}

// The level of a distance, metres, coming from level `from`: a coarser one is gone over to
// hysteresis_m beyond its distance, and left at it.
function levelAt(distance, from) {
  const {levels} = plants[view.plant], k = scale();
  let level = from;
  while (level + 1 < levels.length && distance >=
         k * (levels[level + 1].switch_distance_m + levels[level + 1].hysteresis_m)) level++;
  while (level > 0 && distance < k * levels[level].switch_distance_m) level--;
  return level;
}

function distances() {
  const last = plants[view.plant].levels.at(-1).switch_distance_m;
  return [0.6 * radius, Math.max(2.5 * scale() * last, 12 * radius)];
}

// Metres from which all of the plant is seen that way, with some air around it.
function start(azimuth, elevation) {
  const back = toward(azimuth, elevation), right = toward(azimuth + 90, 0);
  const up = new THREE.Vector3().crossVectors(back, right), at = new THREE.Vector3();
  const half = Math.tan(camera.fov * degrees / 2) / AIR;
  let needed = radius / 2;
  world.updateMatrixWorld(true);
  for (const {node} of models[0].parts) {
    const {position} = node.geometry.attributes;
    for (let i = 0; i < position.count; i++) {
      at.fromBufferAttribute(position, i).applyMatrix4(node.matrixWorld);
      const seen = Math.max(Math.abs(at.dot(up)), Math.abs(at.dot(right)) / camera.aspect);
      needed = Math.max(needed, at.dot(back) + seen / half);
    }
  }
  return needed;
}

// ---- Drawing -------------------------------------------------------------------------------

function draw() {
  if (!models.length) return;
  const plant = plants[view.plant];
  used = view.level === "auto" ? levelAt(view.distance, used) : view.level;
  dress(used);
  models.forEach(({scene}, level) => { scene.visible = level === used; });
  const light = plant.sun ?? usual;
  sun.position.copy(toward(view.sunAzimuth, view.sunElevation));
  sun.color.setScalar(light.sun);
  sky.color.setScalar(light.sky_above);
  sky.groundColor.setScalar(light.sky_below);
  camera.position.copy(toward(view.azimuth, view.elevation)).multiplyScalar(view.distance);
  camera.far = view.distance + 1.5 * radius;
  camera.near = Math.max(view.distance - 1.5 * radius, 1e-3 * camera.far);
  camera.updateProjectionMatrix();
  camera.lookAt(0, 0, 0);
  renderer.render(world, camera);
  tell();
}

function resize() {
  const {clientWidth: width, clientHeight: height} = canvas;
  if (!width || !height) return;
  renderer.setPixelRatio(window.devicePixelRatio);
  renderer.setSize(width, height, false);
  camera.aspect = width / height;
  camera.fov = plants[view.plant].fov_y_deg;
  camera.updateProjectionMatrix();
}

let waiting = false, times = [], idle = 0; // times: of the frames since it last stood still
function later() {
  if (waiting) return;
  if (performance.now() - times.at(-1) > 500) times = [];
  requestAnimationFrame(frame);
  waiting = true;
}

function frame(now) {
  waiting = false;
  const passed = times.length ? (now - times.at(-1)) / 1000 : 0;
  times.push(now);
  while (times.length > 3 && now - times[0] > 1000) times.shift();
  if (view.turning) {
    view.azimuth = (view.azimuth + TURN * Math.min(passed, 0.5)) % 360;
    later();
  }
  draw();
  const rate = 1000 * (times.length - 1) / (now - times[0]);
  byId("rate").textContent =
    times.length > 2 ? `${rate.toFixed(rate < 10 ? 1 : 0)} frames a second` : "";
  clearTimeout(idle);
  idle = setTimeout(() => { byId("rate").textContent = ""; }, 2000);
}

// ---- Words ---------------------------------------------------------------------------------

function element(tag, text, properties = {}) {
  return Object.assign(document.createElement(tag), {textContent: text}, properties);
}

function keyed(level) {
  const key = element("span", "", {className: "key"});
  key.style.background = colorOf(level);
  return key;
}

// What stays while the plant stays.
let told = "";
function describe() {
  told = "";
  const plant = plants[view.plant], {levels} = plant;
  const number = (value, digits) => value.toLocaleString("en", digits === undefined ? {} :
    {minimumFractionDigits: digits, maximumFractionDigits: digits});
  byId("name").textContent = plant.name;
  canvas.setAttribute("aria-label", plant.name);
  byId("facts").textContent = `${metres(plant.extent_m)}, ${number(levels[0].triangles)} ` +
    `triangles, ${levels.length - 1} ${levels.length === 2 ? "level" : "levels"} of detail`;
  byId("held").replaceChildren(...["auto", ...levels.keys()].map((value) => {
    const label = element("label", value === "auto" ? "By distance" : String(value));
    label.prepend(element("input", "", {type: "radio", name: "level", value}));
    if (value === 0 && plant.original) label.title = "The original";
    return label;
  }));
  byId("levels").replaceChildren(...levels.map((level, index) => {
    const name = index || !plant.original ? `LOD${index}` : "Original";
    const row = element("tr", ""), head = element("th", name);
    head.scope = "row";
    head.prepend(keyed(index));
    const flip = level.measured?.flip.mean, live = level.measured?.live.flip.mean;
    row.append(head, ...[
      level.kind, number(level.triangles), number(level.texels), number(level.bytes / 1000, 0),
      index ? metres(level.switch_distance_m).slice(0, -2) : "0", "",
      flip === undefined ? "–" : number(flip, 3), live === undefined ? "–" : number(live, 3),
    ].map((text) => element("td", text)));
    return row;
  }));
  byId("bar").replaceChildren(...levels.map((level, index) => {
    const part = element("span", String(index));
    part.style.setProperty("--of", colorOf(index));
    return part;
  }));
  const unlit = levels.flatMap((level, index) => level.unlit ? [`LOD${index}`] : []);
  byId("baked").hidden = !unlit.length;
  byId("baked").textContent = `Light is in the colours of ${unlit.join(", ")} already` +
    (plant.sun ? `, of a sun at azimuth ${plant.sun.azimuth_deg}°, elevation ` +
                 `${plant.sun.elevation_deg}°` : "") + ": the sun moves that of the others alone.";
}

// What changes with the canvas.
function measure() {
  const plant = plants[view.plant], {levels} = plant, k = scale();
  const [low, high] = distances(), length = Math.log(high / low);
  const from = levels.map((level) => Math.log(clamp(low, k * level.switch_distance_m, high) / low));
  levels.forEach((level, index) => {
    byId("levels").rows[index].cells[6].textContent =
      index ? metres(k * level.switch_distance_m).slice(0, -2) : "0";
    byId("bar").children[index].style.width =
      `${100 * ((from[index + 1] ?? length) - from[index]) / length}%`;
  });
  byId("scale").textContent = `Stated for a field of view of ${plant.fov_y_deg}° and an image ` +
    `of ${plant.image_height_px} pixels; this picture is ${canvas.height} pixels high, so that ` +
    `distances are ${k.toPrecision(3)} times as large here.`;
}

// What changes with every picture.
function tell() {
  const plant = plants[view.plant], level = plant.levels[used], held = view.level !== "auto";
  const name = used || !plant.original ? `LOD${used}` : "Original";
  const shown = `${name}${held ? ", held" : ""}`;
  const pixels = plant.extent_m * pixelsPerRadian(canvas.height, camera.fov) / view.distance;
  if (byId("shown").textContent !== shown) byId("shown").textContent = shown; // read out once
  byId("size").textContent = `, ${level.triangles.toLocaleString("en")} triangles; ` +
    `${metres(view.distance)}, ${pixels.toFixed(0)} px`;
  document.querySelector("#now .key").style.background = colorOf(used);
  [...byId("levels").rows].forEach((row, index) => {
    if (index === used) row.setAttribute("aria-current", "true");
    else row.removeAttribute("aria-current");
    byId("bar").children[index].classList.toggle("used", index === used);
  });
  const now = JSON.stringify(view);
  if (now === told) return;
  told = now;
  const [low, high] = distances();
  const slide = (id, value, text) => {
    byId(id).value = value;
    byId(id).setAttribute("aria-valuetext", text);
    byId(`${id}-said`).textContent = text;
  };
  slide("distance", 1000 * Math.log(view.distance / low) / Math.log(high / low),
        metres(view.distance));
  slide("sun-azimuth", view.sunAzimuth, `${view.sunAzimuth.toFixed(0)}°`);
  slide("sun-elevation", view.sunElevation, `${view.sunElevation.toFixed(0)}°`);
  for (const id of ["colored", "wireframe", "turning"]) byId(id).checked = view[id];
  for (const input of byId("held").querySelectorAll("input")) {
    input.checked = input.value === String(view.level);
  }
}

// ---- Hands ---------------------------------------------------------------------------------

// Changes settings, within their limits.
function change(changes) {
  Object.assign(view, changes);
  const [low, high] = distances();
  view.distance = clamp(low, view.distance, high);
  view.elevation = clamp(-STEEPEST, view.elevation, STEEPEST);
  view.azimuth = ((view.azimuth % 360) + 360) % 360;
}

function show(changes) {
  change(changes);
  later();
}

function reset() {
  const [x, y, z] = usual.direction, baked = plants[view.plant].sun;
  resize();
  used = 0;
  change({
    level: "auto", distance: start(FROM.azimuth, FROM.elevation), ...FROM,
    sunAzimuth: baked?.azimuth_deg ?? Math.atan2(x, z) / degrees,
    sunElevation: clamp(0, baked?.elevation_deg ?? Math.asin(y) / degrees, 90),
    colored: false, wireframe: false, turning: false,
  });
  measure();
  draw();
}

function choose(index) {
  view.plant = index;
  byId("plant").value = index;
  const opened = open(index);
  opened.catch((error) => complain(`This plant cannot be drawn: ${error.message ?? error}`));
  return opened;
}

const pointers = new Map(); // the place of each finger or button that is down
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, event);
});
for (const end of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
}
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const other = [...pointers.values()].find(({pointerId}) => pointerId !== event.pointerId);
  pointers.set(event.pointerId, event);
  if (!other) {
    const turn = 180 / canvas.clientHeight;
    return show({
      azimuth: view.azimuth - turn * (event.clientX - before.clientX),
      elevation: view.elevation + turn * (event.clientY - before.clientY),
    });
  }
  const apart = ({clientX, clientY}) =>
    Math.hypot(clientX - other.clientX, clientY - other.clientY);
  show({distance: view.distance * apart(before) / Math.max(apart(event), 1)});
});
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const lines = event.deltaMode ? 30 : 1; // pixels of a line, where it counts those
  show({distance: view.distance * Math.exp(clamp(-0.3, event.deltaY * lines * 0.0015, 0.3))});
}, {passive: false});
const KEYS = {
  ArrowLeft: () => show({azimuth: view.azimuth - STEP}),
  ArrowRight: () => show({azimuth: view.azimuth + STEP}),
  ArrowUp: () => show({elevation: view.elevation + STEP}),
  ArrowDown: () => show({elevation: view.elevation - STEP}),
  "+": () => show({distance: view.distance / CLOSER}),
  "=": () => show({distance: view.distance / CLOSER}),
  "-": () => show({distance: view.distance * CLOSER}),
  Home: reset,
};
canvas.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key]();
});

byId("controls").addEventListener("submit", (event) => event.preventDefault());
byId("held").addEventListener("change", ({target: {value}}) =>
  show({level: value === "auto" ? value : Number(value)}));
byId("distance").addEventListener("input", ({target: {value}}) => {
  const [low, high] = distances();
  show({distance: low * (high / low) ** (value / 1000)});
});
for (const [id, key] of [["sun-azimuth", "sunAzimuth"], ["sun-elevation", "sunElevation"]]) {
  byId(id).addEventListener("input", ({target: {value}}) => show({[key]: Number(value)}));
}
for (const id of ["colored", "wireframe", "turning"]) {
  byId(id).addEventListener("change", ({target: {checked}}) => show({[id]: checked}));
}
byId("reset").addEventListener("click", reset);
byId("plant").append(...plants.map(({name}, value) => element("option", name, {value})));
byId("plant").addEventListener("change", ({target: {value}}) => choose(Number(value)));
byId("choice").hidden = plants.length < 2;
new ResizeObserver(() => {
  resize();
  if (!models.length) return;
  change({});
  told = "";
  measure();
  draw(); // at once: a canvas of another size is empty
}).observe(canvas);

// For scripts: settings go in, what is drawn by them comes out.
window.vegtool = {
  ready: choose(0),
  choose,
  set(changes) {
    change(changes);
    draw();
    return {...view, used, scale: scale(), width: canvas.width, height: canvas.height};
  },
};
})();
