// What the tests of the page share: --name value options, Chromium (or exit status 77: skipped), and waiting.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

export const options = {};
for (let i = 2; i + 1 < process.argv.length; i += 2) options[process.argv[i].slice(2)] = process.argv[i + 1];
export const skip = (why) => {
  console.log(`skipped: ${why}`);
  process.exit(77);
};
export const chromiumPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].find(existsSync);
if (!chromiumPath) skip("there is no /usr/bin/chromium");
if (!existsSync(join(options.modules, "node_modules/playwright-core"))) skip("playwright-core is not installed");
export const { chromium } = createRequire(join(options.modules, "package.json"))("playwright-core");
export const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
// until(what, condition): what the condition gives once it is true, within so many milliseconds.
export const waiting = (usual) => async (what, condition, atMost = usual) => {
  const end = Date.now() + atMost;
  for (;;) {
    const value = await condition();
    if (value) return value;
    assert.ok(Date.now() < end, `not within ${atMost} ms: ${what}`);
    await sleep(50);
  }
};
