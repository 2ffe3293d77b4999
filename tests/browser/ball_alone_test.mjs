// From cameras of which nothing is known to positions within 10 mm with the ball alone: no lens, no board, no tape. It gets a name, is
// clicked on, waved and thrown, in a browser, with the real service on films in the place of cameras, the real bridge and the real
// huetrack-calibrate. The service is given which cameras there are, and that it may be asked; this test writes no file. The ball's
// radius is not typed: its fall shows the scale.
//   exit 0: passed, 77: skipped (no Chromium), anything else: failed. Screenshots are left in --out.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";

import { closeTool, lookAt, openPage, options, run, say, startWith, waiting } from "./harness.mjs";
import { limeIn, rmsOf, trackedPositions } from "./truth.mjs";

const domain = "78";
const folder = mkdtempSync(join(tmpdir(), "huetrack-ball-alone-"));
const films = join(folder, "films");
const config = join(folder, "my.yaml"), taught = join(folder, "my.taught.yaml");
const until = waiting(60000);
const cameras = ["cam0", "cam1", "cam2"];
const radius_m = 0.05; // of the films' ball (tests/soak/wave_films.h)

// The ball's path, of equal steps: t, x, y, z.
function pathOf(file) {
  const rows = readFileSync(file, "utf8").trim().split("\n").map((line) => line.split(",").map(Number));
  const step_s = rows[1][0] - rows[0][0], round_s = rows.length * step_s;
  const ball = (t) => {
    const at = (((t % round_s) + round_s) % round_s) / step_s, k = Math.floor(at), share = at - k;
    const [from, to] = [rows[k % rows.length], rows[(k + 1) % rows.length]];
    return [1, 2, 3].map((i) => from[i] + share * (to[i] - from[i]));
  };
  return { ball, round_s };
}

// What stands on the page names no option of a command, and no file to be edited.
async function assertNoCommand(page, where) {
  const text = await page.evaluate(() => document.body.innerText);
  assert.doesNotMatch(text, /(^|\s)--[a-z]|huetrack-calibrate|\.yaml:\d/m, where);
}

async function test() {
  const { page, problems } = await openPage(domain, until);
  const service = startWith({ PATH: `${dirname(options.calibrate)}:${process.env.PATH}` }, options.service, config, films,
    "--phases", "together", "--make-waves", "5", "--domain", domain);
  const current = () => page.textContent("#steps-list [data-step=current]").catch(() => "");
  const next = (label) => page.click(`#steps-list [data-step=current] button:text-is("${label}")`);

  // ---- Nothing is known of the cameras: the ball is the first way, and a board the second one.
  await until("a calibration is missed", async () => /Calibration.*The ball alone finds them: first give it a name/s.test(await current()), 90000).catch((error) => {
    throw new Error(service.err, { cause: error });
  });
  await until("all cameras are seen", async () => (await page.locator("#cameras .awaited:visible").count()) === 0 && (await page.locator("#cameras canvas").count()) === 3);
  assert.deepEqual(await page.locator("#steps-list [data-step=current] button").allTextContents(), ["Add the ball…", "With a board…"]);
  await lookAt(page, "1_nothing_known");
  await assertNoCommand(page, "nothing is known");

  // ---- Its name.
  await next("Add the ball…");
  await page.fill("#adjust-name", "ball");
  await page.click("#adjust-add");
  await until("it is added", async () => /^Added: ball/.test(await page.textContent("#adjust-says")));
  await closeTool(page);

  // ---- Its colour: a click on it in each picture.
  await until("a click is missed", async () => /Calibration.*click on ball in each picture/s.test(await current()), 30000);
  await next("Teach ball…");
  await until("all pictures are frozen", async () => (await page.locator("#cameras .frozen canvas[role=application]").count()) === 3);
  const frozen = (camera) => page.locator(`#cameras figure:has(b:text-is("${camera}")) canvas`);
  const places = new Map();
  for (const camera of cameras) places.set(camera, await limeIn(frozen(camera))); // before the mask lies over it
  for (const [i, camera] of cameras.entries()) {
    await frozen(camera).click({ position: places.get(camera) });
    await until(`${camera} is learnt`, async () => (await page.textContent("#teach-says")).startsWith(`Learnt from ${i + 1} of 3`));
  }
  assert.match(await page.textContent("#teach-says"), /Learnt from 3 of 3.*radius cannot be measured: the cameras are not calibrated yet/);
  await lookAt(page, "2_taught");
  await page.click("#teach-save");
  await until("it is saved", async () => /^Saved: ball is now tracked by this colour/.test(await page.textContent("#teach-says")));
  await assertNoCommand(page, "the colour is taught");
  await closeTool(page);

  // ---- Waved and thrown, while the page shows what each camera has seen of it.
  await until("a wave is missed", async () => /Calibration.*wave ball through the room, then throw it five times/s.test(await current()), 30000);
  await next("Wave ball…");
  assert.equal(await page.isChecked("input[name=calibrate-kind][value=wave]"), true);
  await until("the lenses are said to be unknown", async () => /The lenses are unknown yet/.test(await page.textContent("#calibrate-from-nothing")) && page.isVisible("#calibrate-from-nothing"));
  await lookAt(page, "3_wave");
  const { ball, round_s } = pathOf(join(films, "ball.csv"));
  await page.fill("#calibrate-seconds", String(Math.ceil(round_s) + 4)); // one round, and the beginning of the recording
  const says = () => page.textContent("#calibrate-says");
  const seen = async () => [...(await page.textContent("#calibrate-cameras")).matchAll(/(\d+) of 150 pictures of it moving/g)].map((m) => Number(m[1]));
  // Where frames are lost on a busy computer, once more, as the page says.
  for (let attempt = 1; ; attempt++) {
    await page.click("#calibrate-from-now");
    await until("it is seen moving by all", async () => (await seen()).length === 3 && (await seen()).every((n) => n > 20));
    assert.match(await page.textContent("#calibrate-step"), /then throw it five times and let it bounce/);
    if (attempt === 1) await page.screenshot({ path: join(options.out, "4_coverage.png") });
    await until("it is solved", async () => !(await page.isVisible("#calibrate-run")) && /^(Usable|Doubtful|It failed)/.test(await says()), 300000);
    say(await says());
    if ((await says()).startsWith("Usable")) break;
    await assertNoCommand(page, "the verdict");
    assert.ok(attempt < 3, "three times it is not usable");
  }
  const [, error_mm] = (await says()).match(/^Usable: the expected error of positions is (\d+\.\d) mm/) ?? [];
  assert.ok(Number(error_mm) < 10, `an expected error of ${error_mm} mm`);
  await lookAt(page, "5_verdict");
  await assertNoCommand(page, "the verdict");

  // ---- Used: it is tracked, with the radius that its fall has shown.
  await page.click("#calibrate-accept");
  await until("it is accepted", async () => /my\.rig-.*-wave(-\d+)?\.yaml is now the rig/.test(await says()));
  await closeTool(page);
  await until("it is tracked", async () => (await page.getAttribute("#targets li[data-target=ball]", "data-state").catch(() => "")) === "tracking");
  const size = Number(readFileSync(taught, "utf8").match(/radius_m: (0\.\d+)/)?.[1]);
  assert.ok(Math.abs(size - radius_m) < 0.05 * radius_m, `a radius of ${size} m`);
  const positions = await trackedPositions(page, 120);
  await lookAt(page, "6_tracked");
  const rms = rmsOf(positions, ball, round_s);
  say(`tracked with the ball alone: ${positions.length} positions, rms ${(1000 * rms).toFixed(1)} mm, radius ${1000 * size} mm of ${1000 * radius_m}`);
  assert.ok(rms < 0.01, `${1000 * rms} mm`);
  assert.ok(existsSync(config));
  assert.deepEqual(problems, []);
}

await run(test, { folder });
