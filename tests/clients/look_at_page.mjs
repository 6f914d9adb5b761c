// A page of vegtool preview --html, opened from its file in headless Chromium.
// stdin: {page, width, height, steps: [{keys, drag, slide, set, out}, ...]}
//   width, height: CSS pixels of the window. keys: pressed while the canvas has the focus. drag:
//   [right, down], pixels, over the canvas. slide: [id, value] of a slider. set: what
//   window.vegtool.set is told. out: PNG of the page's canvas afterwards, RGBA. Only these two have
//   to be there.
// stdout: one JSON object per step, what set answers; then {complaints, asked}, what the page
//   complains of and the addresses, other than blob:, that it asks for after itself.
import fs from 'node:fs';
import {pathToFileURL} from 'node:url';
import {inBrowser} from './browser.mjs';
import {readInput} from './packages.mjs';

const {page, width, height, steps} = await readInput();

await inBrowser('window.ready = true;', [], async (tab, complaints) => {
  const asked = [], address = pathToFileURL(page).href;
  tab.on('request', (request) => asked.push(request.url()));
  await tab.setViewport({width, height, deviceScaleFactor: 1});
  await tab.goto(address);
  await tab.evaluate('window.vegtool.ready');
  for (const {keys = [], drag, slide, set, out} of steps) {
    if (keys.length) await tab.focus('#canvas');
    for (const key of keys) await tab.keyboard.press(key);
    if (drag) {
      await tab.mouse.move(300, 300);
      await tab.mouse.down();
      await tab.mouse.move(300 + drag[0], 300 + drag[1]);
      await tab.mouse.up();
    }
    if (slide) {
      await tab.$eval(`#${slide[0]}`, (slider, value) => {
        slider.value = value;
        slider.dispatchEvent(new Event('input', {bubbles: true}));
      }, slide[1]);
    }
    const [state, picture] = await tab.evaluate((changes) => {
      const told = window.vegtool.set(changes);
      const shown = document.getElementById('shown').textContent;
      const row = document.querySelector('#levels [aria-current]').rowIndex - 1;
      // in the same task: what is drawn is gone after it
      return [{...told, shown, row}, document.getElementById('canvas').toDataURL('image/png')];
    }, set);
    fs.writeFileSync(out, Buffer.from(picture.split(',')[1], 'base64'));
    console.log(JSON.stringify(state));
  }
  const others = asked.filter((url) => url !== address && !url.startsWith('blob:'));
  console.log(JSON.stringify({complaints, asked: others}));
});
