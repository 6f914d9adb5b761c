// three.js in linear light, under a sun and a sky alone: a part of pages that draw so.
// light: {sun, above, below}, strengths as factors of the albedo.
// The page has `renderer`, `sun` and `sky`, lights for its scenes; lambert(material), which has the
// textures, factors, cutoff and sides of another and becomes Lambert's; and picture(scene, camera,
// towards, width, height), with the sun that way: base64 of RGBA as half floats, lowest row first,
// linear and premultiplied. Pictures are multisampled (4x) in half-float linear light, as three's
// own effect composer draws them.
export const inLinearLight = (light) => `
const light = ${JSON.stringify(light)};
const ANISOTROPY = 4, SAMPLES = 4;
const renderer = new THREE.WebGLRenderer({alpha: true, antialias: false});
renderer.setClearColor(0x000000, 0);
// Lambert's law divides the albedo by pi
const gray = (value) => new THREE.Color(value, value, value).multiplyScalar(Math.PI);
const sun = new THREE.DirectionalLight(gray(light.sun), 1);
const sky = new THREE.HemisphereLight(gray(light.above), gray(light.below), 1);

function lambert(old) {
  const {map, normalMap, normalScale, alphaTest, side, color, vertexColors} = old;
  for (const texture of [map, normalMap]) if (texture) texture.anisotropy = ANISOTROPY;
  return new THREE.MeshLambertMaterial(
    {map, normalMap, normalScale, alphaTest, side, color, vertexColors});
}

function picture(scene, camera, towards, width, height) {
  sun.position.set(...towards);
  const target = new THREE.WebGLRenderTarget(
    width, height, {type: THREE.HalfFloatType, samples: SAMPLES});
  renderer.setRenderTarget(target);
  renderer.clear();
  renderer.render(scene, camera);
  const pixels = new Uint16Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  target.dispose();
  const bytes = new Uint8Array(pixels.buffer), parts = [];
  for (let i = 0; i < bytes.length; i += 8192) {
    parts.push(String.fromCharCode(...bytes.subarray(i, i + 8192)));
  }
  return btoa(parts.join(''));
}
`;
