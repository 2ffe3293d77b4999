// `huetrackd demo` as somebody without a camera walks it: a moving ball, its position, Teach, the calibration, a recording. In each
// window nothing that is needed for that is below the fold. Screenshots are left in --out.
//   exit 0: passed, 77: skipped (no Chromium), anything else: failed
import assert from "node:assert/strict";
import { mkdtempSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";

import { belowTheFold, closeTool, launch, lookAt, openTool, options, run, say, startWith, visit, waiting, windows } from "./harness.mjs";

const until = waiting(60000);
const folder = mkdtempSync(join(tmpdir(), "huetrack_demo_"));

async function test() {
  const demo = startWith({ ROS_DOMAIN_ID: "79", PATH: `${dirname(options.huetrack)}:${process.env.PATH}` }, options.huetrackd, "demo", "--port", "0", folder);
  const address = await until("the demo prints its address", () => demo.out.match(/http:\S+/)?.[0]);
  await launch();
  for (const name of ["laptop", "phone"]) {
    const [width, height] = windows[name];
    const { page, problems } = await visit(address, { width, height });
    const place = () => page.textContent("#targets .position");
    await until("the ball has a position", async () => (await page.locator("#targets .position").count()) && /x -?\d/.test(await place()));
    await until("the service has said what it is", async () => (await page.getAttribute("#link", "data-link")) === "good");
    await until("that a recording is played", async () => /a recording, played as if live/.test(await page.textContent("#service")));
    const before = await place();
    await until("it moves", async () => (await place()) !== before);
    const sees = async (what, ...needed) => assert.deepEqual(await belowTheFold(page, ["#tools button", ...needed]), [], `${name}: ${what}`);
    await closeTool(page);
    await sees("to read a position", "#cameras canvas", "#targets .position", "#targets .state", "#scene");
    await openTool(page, "teach");
    await until("frozen pictures", async () => (await page.locator("#cameras .frozen canvas[role=application]").count()) === 2);
    await sees("to teach", "#cameras canvas", "#teach-says", "#teach-save");
    if (name === "laptop") await lookAt(page, "demo_teach");
    await page.click("#teach-close");
    await openTool(page, "calibrate");
    await until("it can be calibrated by the waved ball", () => page.isEnabled("#calibrate-panel .tool-foot button:visible >> nth=0"));
    await sees("to calibrate", "#cameras canvas", "#calibrate-panel .tool-foot button");
    if (name === "laptop") await lookAt(page, "demo_calibrate");
    await openTool(page, "recordings");
    await until("it can be recorded", () => page.isEnabled("#record-start"));
    await sees("to record", "#cameras canvas", "#record-start");
    await until("that there is no recording yet", () => page.isVisible("#recordings-none"));
    await closeTool(page);
    if (name === "laptop") await lookAt(page, "demo");
    await page.evaluate(() => localStorage.clear());
    assert.deepEqual(problems, []);
    await page.close();
    say(`${name}: position, Teach, calibration, recording`);
  }
  demo.child.kill("SIGINT");
  assert.equal(await demo.ended, 0, demo.err);
}

await run(test, { folder });
