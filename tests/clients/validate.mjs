// Khronos's glTF validator over many files.
// stdin: JSON list of paths. stdout: one JSON object per line,
//   {file, errors, warnings, infos, messages: [{code, message, pointer, severity}]}
import fs from 'node:fs';
import {load, readInput} from './packages.mjs';

const validator = load('gltf-validator');
for (const file of await readInput()) {
  const {issues} = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: file,
    maxIssues: 50,
    externalResourceFunction: () => Promise.reject(new Error('a .glb stands alone')),
  });
  const {numErrors: errors, numWarnings: warnings, numInfos: infos, messages} = issues;
  console.log(JSON.stringify({file, errors, warnings, infos, messages}));
}
