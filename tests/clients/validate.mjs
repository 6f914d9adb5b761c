// Khronos's glTF validator over many files.
// stdin: {files, alone}, paths. alone: true where no file may need others beside it.
// stdout: one JSON object per line,
//   {file, errors, warnings, infos, messages: [{code, message, pointer, severity}]}
import fs from 'node:fs';
import path from 'node:path';
import {load, readInput} from './packages.mjs';

const validator = load('gltf-validator');
const {files, alone} = await readInput();
for (const file of files) {
  const beside = async (uri) => {
    if (alone) throw new Error('a .glb stands alone');
    const found = path.join(path.dirname(file), decodeURIComponent(uri));
    return new Uint8Array(fs.readFileSync(found));
  };
  const {issues} = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: file, maxIssues: 50, externalResourceFunction: beside,
  });
  const {numErrors: errors, numWarnings: warnings, numInfos: infos, messages} = issues;
  console.log(JSON.stringify({file, errors, warnings, infos, messages}));
}
