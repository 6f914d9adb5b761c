// Where the npm packages are: VEGTOOL_NODE_MODULES, or node_modules beside this file.
import {createRequire} from 'node:module';
import path from 'node:path';
import {fileURLToPath} from 'node:url';

const fallback = fileURLToPath(new URL('node_modules', import.meta.url));
export const folder = path.resolve(process.env.VEGTOOL_NODE_MODULES || fallback);
export const load = createRequire(path.join(folder, 'from-here.js'));

export async function readInput() {
  const parts = [];
  for await (const part of process.stdin) parts.push(part);
  return JSON.parse(Buffer.concat(parts).toString());
}
