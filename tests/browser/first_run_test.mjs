// The first run, as the page tells it: from cameras that nobody has calibrated and no target at all to a track within 10 mm, with a
// browser alone: exposure, a calibration from a board, the colour by a click, then once more a calibration by the waved object. With
// the real service on films in the place of cameras, which show a board until they are calibrated, the real bridge and the real
// huetrack-calibrate. The service is given which cameras there are, and that it may be asked; this test writes no file. At every step
// the page is looked at in windows of four shapes.
//   exit 0: passed, 77: skipped (no Chromium), anything else: failed. Screenshots are left in --out.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readFileSync, readdirSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";

import { belowTheFold, closeTool, lookAt, openPage, openTool, options, run, say, sleep, startWith, waiting } from "./harness.mjs";
import { limeIn, rmsOf, trackedPositions } from "./truth.mjs";

const domain = "76";
const folder = mkdtempSync(join(tmpdir(), "huetrack-first-run-"));
const films = join(folder, "films");
const config = join(folder, "my.yaml"), taught = join(folder, "my.taught.yaml");
const until = waiting(60000);
// In the order in which they were begun. Of two of one second the later one is named ...-2.
const recordings = () => readdirSync(join(folder, "recordings")).sort();
const kindOf = (recording) => recording.match(/Z-([a-z]+)/)[1];

// Where the ball of the films is, a time after they began (tests/soak/films.h).
const ball = (t) => [0.4 * Math.cos(Math.PI * t), 0.4 * Math.sin(Math.PI * t), 1 + 0.2 * Math.sin(2 * Math.PI * t)];

async function test() {
  const { address, page, problems } = await openPage(domain, until);
  const current = () => page.textContent("#steps-list [data-step=current]").catch(() => "");
  const picture = (name) => lookAt(page, name);

  // ---- Cameras: none is found, and the page shows a file to begin with; then they come.
  await until("a service is missed", async () => /Cameras.*No huetrackd was found on DDS domain 76/s.test(await current()));
  assert.match(await page.textContent("#steps-list pre"), /^version: 1\nrig: none[\s\S]*allow_teach: true, allow_record: true/m);
  await picture("1_cameras");
  const service = startWith({ PATH: `${dirname(options.calibrate)}:${process.env.PATH}` }, options.service, config, films,
    "--phases", "together", "--make-boards", "14", "--domain", domain);

  // ---- Exposure: the pictures come, and are neither too dark nor too bright. Then nothing is calibrated.
  await until("calibration is missed", async () => /Calibration.*lenses and poses of cam0, cam1 are unknown/s.test(await current()), 40000).catch((error) => {
    throw new Error(service.err, { cause: error });
  });
  assert.match(await page.textContent("#steps-list"), /cam0, cam1 deliver.*Neither too dark nor too bright/);
  assert.match(await page.textContent("#warnings"), /not calibrated/);
  assert.equal(await page.textContent("#warnings button"), "Calibrate…");
  await until("both cameras are seen", async () => (await page.locator("#cameras canvas").count()) === 2 && (await page.locator("#cameras .awaited:visible").count()) === 0);
  assert.equal(await page.locator("#targets li").count(), 0, "nothing is tracked before");
  await picture("2_calibration");

  // ---- Calibration: a board is carried, the page shows what is still missing, and what came of it.
  const says = () => page.textContent("#calibrate-says");
  await page.click("#steps-list [data-step=current] button:text-is('With a board…')");
  await page.selectOption("#calibrate-type", "chessboard");
  assert.equal(await page.getAttribute("#calibrate-square_mm", "placeholder"), "25", "what is assumed is shown");
  assert.deepEqual(await belowTheFold(page, ["#cameras canvas", "#calibrate-start", "#calibrate-type"]), []);
  assert.equal(await page.isVisible("#calibrate-marker_mm"), false, "a chessboard has no markers");
  assert.equal(await page.isDisabled("input[name=calibrate-kind][value=wave]"), false, "the ball alone would do, too");
  await page.selectOption("#calibrate-type", "charuco");
  await page.fill("#calibrate-columns", "1");
  await page.click("#calibrate-start");
  await until("it is said that there is no such board", async () => /^It failed: a charuco board has at least 3 x 3/.test(await says()));
  await page.selectOption("#calibrate-type", "chessboard");
  for (const [id, value] of [["columns", 7], ["rows", 5], ["square_mm", 80]]) await page.fill(`#calibrate-${id}`, String(value));
  await page.click("#calibrate-start");
  const seen = async () => [...(await page.textContent("#calibrate-cameras")).matchAll(/(\d+) of 15 views/g)].map((m) => Number(m[1]));
  await until("corners are seen in both", async () => (await seen()).length === 2 && (await seen()).every((n) => n >= 2), 90000);
  assert.ok((await page.locator("#calibrate-needs li").count()) > 0, "something is missing yet");
  assert.deepEqual(await belowTheFold(page, ["#cameras canvas", "#calibrate-stop", "#calibrate-needs li:first-child"]), []);
  await picture("3_coverage");
  await until("it was in most places", async () => (await seen()).every((n) => n >= 9), 60000);
  say(`views: ${await seen()}; missing: ${await page.locator("#calibrate-needs li").allTextContents()}`);
  await picture("4_covered");
  await page.click("#calibrate-stop");
  await until("it is solved", async () => /^(Usable|Doubtful|It failed)/.test(await says()), 150000);
  say(await says());
  assert.match(await says(), /^(Usable|Doubtful): corners fit to 0\.\d+ px rms/);
  await picture("5_verdict");
  const report = await page.request.get(new URL("/api/calibration.html", address).href);
  assert.equal(report.status(), 200);
  assert.match(report.headers()["content-security-policy"], /^sandbox; default-src 'none'/);
  assert.match(await report.text(), /<h2>Cameras<\/h2>/);
  const isDoubtful = /^Doubtful/.test(await says());
  await page.click("#calibrate-accept");
  if (isDoubtful) {
    assert.match(await page.textContent("#calibrate-accept"), /^Yes/);
    await page.click("#calibrate-accept");
  }
  await until("it is accepted", async () => /my\.rig-.*-board(-\d+)?\.yaml is now the rig/.test(await says()));
  await closeTool(page); // the steps come back
  await until("the step is done", async () => /Colour.*No target yet/s.test(await current()), 30000);

  // ---- Colour: a target, and which colour it has.
  await page.click("#steps-list [data-step=current] button");
  await page.fill("#adjust-name", "ball");
  assert.equal(await page.inputValue("#adjust-radius"), "", "its radius is left open");
  await page.click("#adjust-add");
  await until("it is added", async () => /^Added: ball/.test(await page.textContent("#adjust-says")));
  await closeTool(page);
  await until("a colour is missed", async () => /Colour.*What colour is ball\?/s.test(await current()), 30000);
  await picture("6_colour");
  await page.click("#steps-list [data-step=current] button");
  await until("both pictures are frozen", async () => (await page.locator("#cameras .frozen canvas[role=application]").count()) === 2);
  const frozen = (camera) => page.locator(`#cameras figure:has(b:text-is("${camera}")) canvas`);
  const places = { cam0: await limeIn(frozen("cam0")), cam1: await limeIn(frozen("cam1")) }; // before the mask lies over them
  for (const camera of ["cam0", "cam1"]) {
    await frozen(camera).click({ position: places[camera] });
    await until(`${camera} is learnt`, async () => (await page.getAttribute("#teach-panel", "aria-busy")) === "false" && /Learnt from/.test(await page.textContent("#teach-says")));
  }
  assert.match(await page.textContent("#teach-says"), /Learnt from 2 of 2.*It has a radius of \d+(\.\d)? mm, give or take/);
  await sleep(3000); // in which it moves on: more moments tell how large it is
  await picture("7_taught");
  await page.click("#teach-save");
  await until("it is saved", async () => /^Saved: ball is now tracked by this colour and with this radius/.test(await page.textContent("#teach-says")));
  const size = Number(readFileSync(taught, "utf8").match(/radius_m: (0\.\d+)/)[1]);
  say(`${await page.textContent("#teach-says")} (40 mm is right)`);
  assert.ok(Math.abs(size - 0.04) < 0.0025, `a radius of ${size} m`);

  // ---- Track.
  const state = () => page.getAttribute("#targets li[data-target=ball]", "data-state").catch(() => "");
  await until("it is tracked", async () => (await state()) === "tracking");
  await closeTool(page);
  assert.equal(await page.isHidden("#steps"), true);
  await sleep(2000); // what is behind the ball is learnt
  await picture("8_track");
  const positions = await trackedPositions(page, 80);
  const rms = rmsOf(positions, ball, 2);
  say(`tracked from nothing: ${positions.length} positions, rms ${(1000 * rms).toFixed(1)} mm`);
  assert.ok(rms < 0.01, `${1000 * rms} mm`);
  await openTool(page, "steps");
  await until("all steps are done", async () => (await page.locator("#steps-list [data-step=done]").count()) === 5);

  // ---- Undone: the target has no colour again; and the undoing.
  const saved = readFileSync(taught, "utf8");
  assert.match(saved, /^rig: .*my\.rig-/m);
  await openTool(page, "teach");
  await page.click("#teach-undo");
  await until("it is undone", async () => /^Undone: colour[^;]*; my\.taught\.yaml is as it was before/.test(await page.textContent("#teach-says")));
  await until("it is not tracked any more", async () => (await state()) === "searching");
  await page.click("#teach-redo");
  await until("it is tracked again", async () => (await state()) === "tracking");
  assert.equal(readFileSync(taught, "utf8"), saved);

  // ---- The board, as it is printed.
  await openTool(page, "calibrate");
  await page.click("#calibrate-board summary");
  await page.selectOption("#calibrate-paper", "A1");
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#calibrate-print")]);
  assert.equal(download.suggestedFilename(), "board.pdf");
  const pdf = readFileSync(await download.path(), "latin1");
  assert.match(pdf, /^%PDF/);
  say(`board.pdf: ${pdf.length} bytes`);
  await page.fill("#calibrate-square_mm", "900");
  await page.click("#calibrate-print");
  await until("it is said that it does not fit", async () => /^The board cannot be printed: .*(fit|paper|mm)/i.test(await says()));
  await page.fill("#calibrate-square_mm", "80");

  // ---- Waved for some seconds from now on: what each camera has seen of it.
  await page.check("input[name=calibrate-kind][value=wave]");
  await page.fill("#calibrate-seconds", "40");
  await page.click("#calibrate-from-now");
  await until("the wave is seen in both", async () => [...(await page.textContent("#calibrate-cameras")).matchAll(/([1-9]\d*) of 150 pictures of it moving/g)].length === 2, 20000);
  assert.ok((await page.locator("#calibrate-needs li").count()) > 0, "something is missing yet");
  await picture("9_wave_coverage");
  await page.click("#calibrate-cancel");
  await until("it is cancelled", async () => /^Cancelled/.test(await says()));

  // ---- Once more, by the object: the last seconds are calibrated from.
  await sleep(4000); // which it was waved in
  await page.click("#calibrate-last");
  await until("it is solved", async () => /^(Usable|Doubtful|It failed)/.test(await says()), 150000);
  say(await says());
  assert.match(await says(), /^(Usable|Doubtful): the expected error of positions is \d+\.\d mm, the rms error of the ball is 0\.\d+ px/);
  await picture("10_wave");
  assert.equal((await page.request.get(new URL("/api/calibration.html", address).href)).status(), 200);
  // And with a distance that was measured, from the same recording.
  assert.equal(await page.isDisabled("#calibrate-again"), true, "no distance is said");
  await page.fill("#calibrate-metres", "1.9");
  const without = await says();
  await page.click("#calibrate-again");
  // That it runs may be seen too late: another result shows that it ran.
  const isOther = (text) => text !== without && /^(Usable|Doubtful|It failed)/.test(text);
  await until("it is solved again", async () => isOther(await says()) && !(await page.isVisible("#calibrate-run")), 150000);
  say(await says());
  await picture("11_distance");
  const solved = join(folder, "recordings", recordings().filter((name) => kindOf(name) === "wave").at(-1));
  assert.match(readFileSync(join(solved, "calibrated.yaml"), "utf8"), /distance between cam0 and cam1, 1\.900 m/);
  assert.equal(readFileSync(taught, "utf8"), saved, "what nobody accepts changes nothing");
  assert.deepEqual(recordings().map(kindOf).sort(), ["board", "board", "wave", "wave"]);
  assert.ok(existsSync(join(folder, "my.yaml")));
  assert.deepEqual(problems, []);
}

await run(test, { folder });
