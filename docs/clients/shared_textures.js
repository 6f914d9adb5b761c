// One texture for each picture, however many tiles draw it: a plugin for 3d-tiles-renderer.
//
//   import {TilesRenderer} from '3d-tiles-renderer/three';
//   import {SharedTextures} from './shared_textures.js';
//   const tiles = new TilesRenderer('tiles/tileset.json');
//   tiles.registerPlugin(new SharedTextures());
//
// The renderer downloads a picture that tiles share once, and then decodes it and keeps it on the
// GPU for every tile anew. With this, tiles get one and the same texture, which goes when the last
// tile goes that draws it. Of the memory that tiles are said to use (tiles.lruCache), each of them
// counts its share.
//
// Written for 3d-tiles-renderer 0.5 and three 0.187. A plugin with a GLTFLoader of its own, such as
// GLTFExtensionsPlugin, is to be registered before this one, which then adds to that loader.
import {LoaderUtils} from 'three';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {MemoryUtils} from '3d-tiles-renderer/three';

export class SharedTextures {
  name = 'SHARED_TEXTURES';
  shared = new Map();  // {loading, texture, users} by address and sampler; users: tiles

  init(tiles) {
    this.tiles = tiles;
    const known = tiles.manager.getHandler('tile.glb');
    const loader = known ?? new GLTFLoader(tiles.manager);
    loader.register((parser) => ({
      name: this.name, loadTexture: (index) => this.loadTexture(parser, index),
    }));
    if (!known) tiles.manager.addHandler(/\.(gltf|glb)$/, loader);
    tiles.addEventListener('load-model', ({tile}) => this.recount(tile));
    tiles.addEventListener('tiles-load-end', () => this.sweep());
  }

  // Called by the loader, for each texture of a tile; null: its own way.
  loadTexture(parser, index) {
    const {source, sampler} = parser.json.textures[index];
    const {uri} = parser.json.images[source] ?? {};
    if (!uri || uri.startsWith('data:')) return null;
    const address = LoaderUtils.resolveURL(uri, parser.options.path);
    const key = JSON.stringify([address, parser.json.samplers?.[sampler]]);
    if (!this.shared.has(key)) {
      const one = {users: new Set()};
      this.shared.set(key, one);
      one.loading = parser.loadTexture(index).then((texture) => {
        if (texture) one.texture = kept(texture);
        else this.shared.delete(key);  // the next tile may have better luck
        return texture;
      });
    }
    return this.shared.get(key).loading;
  }

  // Called by the renderer, for each tile that is loaded; some are no longer wanted by then.
  processTileModel(scene, tile) {
    if (!this.tiles.lruCache.has(tile)) return;
    const drawn = new Set();
    scene.traverse(({material}) => Object.values(material ?? {}).forEach((v) => drawn.add(v)));
    for (const one of this.shared.values()) if (drawn.has(one.texture)) one.users.add(tile);
  }

  // Called by the renderer, which adds to it what a tile would use alone.
  calculateBytesUsed(tile, scene) {
    if (!scene) return 0;
    let bytes = 0;
    for (const {texture, users} of this.shared.values()) {
      if (!users.has(tile)) continue;
      bytes += MemoryUtils.getTextureByteLength(texture) * (1 / users.size - 1);
    }
    return bytes;
  }

  // Called by the renderer, before it disposes of all that a tile has.
  disposeTile(tile) {
    this.recount(tile, true);
    this.sweep();
  }

  // The shares of those that draw what a tile draws, which has come or goes.
  recount(tile, goes = false) {
    const changed = new Set();
    for (const {users} of this.shared.values()) {
      if (!users.has(tile)) continue;
      if (goes) users.delete(tile);
      users.forEach((user) => changed.add(user));
    }
    for (const user of changed) {
      if (user.engineData.scene) this.tiles.recalculateBytesUsed(user);
    }
  }

  // Let go of what no tile draws, once none is on its way that may.
  sweep() {
    if (this.tiles.stats.parsing) return;
    for (const [key, {texture, users}] of this.shared) {
      if (!texture || users.size) continue;
      this.shared.delete(key);
      release(texture);
    }
  }

  dispose() {
    for (const {texture} of this.shared.values()) if (texture) release(texture);
    this.shared.clear();
  }
}

// What a tile disposes of, it closes: neither does anything to a texture that is kept.
function kept(texture) {
  texture.dispose = () => {};
  if (texture.image?.close) texture.image.close = () => {};
  return texture;
}

function release(texture) {
  delete texture.dispose;
  if (texture.image?.close) {
    delete texture.image.close;
    texture.image.close();
  }
  texture.dispose();
}
