// The first run, as the page tells it: from the few lines that it shows, over cameras that nobody has calibrated and a target
// that nobody has taught, to a track within 10 mm; with the real service on films in the place of cameras, and the real bridge.
// What only a terminal can do (to write that file, to start a service, to calibrate) is done here, when the page asks for it.
//   exit 0: passed, 77: skipped (no Chromium), anything else: failed. Screenshots are left in --out.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { launch, options, run, sleep, start, waiting } from "./harness.mjs";

const domain = "76";
const folder = mkdtempSync(join(tmpdir(), "huetrack-first-run-"));
const films = join(folder, "films");
const config = join(folder, "my.yaml"), taught = join(folder, "my.taught.yaml");
mkdirSync(options.out, { recursive: true });
const until = waiting(20000);
const say = (text) => console.log(text);

// Where the ball of the films is, a time after they began (tests/soak/films.h), and how far positions are from there: rms, m.
// When they began nobody tells: the time is found that fits best.
const ball = (t) => [0.4 * Math.cos(Math.PI * t), 0.4 * Math.sin(Math.PI * t), 1 + 0.2 * Math.sin(2 * Math.PI * t)];
function rmsOf(positions) {
  const rms = (begin) => Math.sqrt(positions.reduce((sum, { t, position }) => sum + Math.hypot(...ball(t - begin).map((v, i) => v - position[i])) ** 2, 0) / positions.length);
  let [begin, step] = [positions[0].t, 0.01];
  const times = Array.from({ length: 200 }, (_, k) => begin + k * step);
  begin = times.reduce((a, b) => (rms(b) < rms(a) ? b : a));
  for (; step > 1e-6; step /= 2) for (const other of [begin - step, begin + step]) if (rms(other) < rms(begin)) begin = other;
  return rms(begin);
}

async function test() {
  const view = start(options.huetrack, "view", "--port", "0", "--domain", domain, "--interface", "lo");
  const address = await until("the bridge says its address", () => view.out.match(/http:\S+/)?.[0]);
  const browser = await launch();
  const page = await browser.newPage({ viewport: { width: 1440, height: 1000 } });
  const problems = [];
  page.on("pageerror", (error) => problems.push(error.message));
  await page.goto(address);
  const current = () => page.textContent("#steps-list [data-step=current]").catch(() => "");
  const picture = (name) => page.screenshot({ path: join(options.out, `${name}.png`), fullPage: true });

  // ---- Cameras: the file that the page shows, with the cameras that there are.
  await until("a service is missed", async () => /Cameras.*No huetrackd is heard on DDS domain 76/.test(await current()));
  const lines = (await page.textContent("#steps-list pre")).split("\n");
  const with_ = (rig) =>
    writeFileSync(config, [...lines.map((line) =>
      line.startsWith("cameras:") ? "cameras: {cam0: {device: 0, size: [320, 240]}, cam1: {device: 1, size: [320, 240]}}"
        : line.startsWith("rig:") ? `rig: ${rig}`
        : line), `dds: {domain: ${domain}, interfaces: [lo]}`, ""].join("\n"));
  with_("none");
  const serve = (...more) => start(options.service, config, films, "--phases", "together", ...more);
  let service = serve("--make", "2");
  await picture("1_cameras");

  // ---- Exposure: the pictures come, and are neither too dark nor too bright. Then nothing is calibrated.
  await until("calibration is missed", async () => /Calibration.*how cam0, cam1 see/s.test(await current())).catch((error) => {
    throw new Error(service.err, { cause: error });
  });
  assert.match(await page.textContent("#steps-list"), /cam0, cam1 deliver.*Neither too dark nor too bright/);
  assert.match(await page.textContent("#steps-list pre"), /^huetrack-calibrate extrinsics --board board\.yaml cam0=\S+ cam1=\S+ --rig rig\.yaml/);
  assert.match(await page.textContent("#warnings"), /not calibrated/);
  assert.match(await page.textContent("#teach-why"), /not calibrated/);
  assert.equal(await page.isDisabled("#teach-open"), true);
  await until("both cameras are seen", async () => (await page.locator("#cameras canvas").count()) === 2 && (await page.locator("#cameras .awaited:visible").count()) === 0);
  assert.equal(await page.locator("#targets li").count(), 0, "nothing is tracked before");
  await picture("2_calibration");
  service.child.kill("SIGTERM");
  await service.ended;

  // ---- Calibrated: the rig of these films stands for what huetrack-calibrate writes, which films are no cameras for.
  with_(join(films, "rig.yaml"));
  service = serve();
  await until("a colour is missed", async () => /Colour.*Which colour has ball\?/.test(await current()));
  await picture("3_colour");
  await page.click("#steps-list button");
  await page.waitForSelector("#teach-pictures canvas[data-camera=cam1]");
  // Where the object is, for somebody who sees lime in a grey room.
  const seen = async (camera) => {
    const canvas = page.locator(`#teach-pictures canvas[data-camera=${camera}]`);
    await canvas.scrollIntoViewIfNeeded();
    return canvas.evaluate((canvas) => {
      const { width, height } = canvas;
      const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
      let [u, v, n] = [0, 0, 0];
      for (let i = 0; i < width * height; i++) {
        const [r, g, b] = data.subarray(4 * i, 4 * i + 3);
        if (g > 100 && g - b > 80 && g >= r) (u += i % width), (v += Math.floor(i / width)), n++;
      }
      const box = canvas.getBoundingClientRect();
      return { x: (u / n / width) * box.width, y: (v / n / height) * box.height };
    });
  };
  const places = { cam0: await seen("cam0"), cam1: await seen("cam1") }; // before the mask lies over them
  for (const camera of ["cam0", "cam1"]) {
    await page.click(`#teach-pictures canvas[data-camera=${camera}]`, { position: places[camera] });
    await until(`${camera} is learnt`, async () => (await page.getAttribute("#teach-panel", "aria-busy")) === "false" && /Learnt from/.test(await page.textContent("#teach-says")));
  }
  assert.match(await page.textContent("#teach-says"), /Learnt from 2 of 2/);
  await page.click("#teach-save");
  await until("it is saved", async () => /^Saved: ball/.test(await page.textContent("#teach-says")));

  // ---- Track.
  const state = () => page.getAttribute("#targets li[data-target=ball]", "data-state").catch(() => "");
  await until("it is tracked", async () => (await state()) === "tracking");
  await until("the steps go", () => page.isHidden("#steps"));
  await sleep(2000); // what is behind the ball is learnt
  await picture("4_track");
  const positions = await page.evaluate(() => new Promise((resolve) => {
    const got = [];
    const events = new EventSource("/api/v1/positions");
    events.addEventListener("position", ({ data }) => {
      const p = JSON.parse(data);
      if (p.state === "tracking") got.push({ t: p.t, position: p.position });
      if (got.length >= 120) events.close(), resolve(got);
    });
  }));
  const rms = rmsOf(positions);
  say(`tracked from nothing: ${positions.length} positions, rms ${(1000 * rms).toFixed(1)} mm`);
  assert.ok(rms < 0.01, `${1000 * rms} mm`);
  await page.click("#steps-open");
  await until("all steps are done", async () => (await page.locator("#steps-list [data-step=done]").count()) === 5);

  // ---- Undone: the target has no colour again; and the undoing.
  assert.ok(existsSync(taught));
  const saved = readFileSync(taught, "utf8");
  await page.click("#teach-undo");
  await until("it is undone", async () => /^Undone: my\.taught\.yaml is as it was before/.test(await page.textContent("#teach-says")));
  assert.equal(existsSync(taught), false);
  await until("it is not tracked any more", async () => (await state()) === "searching");
  await until("its colour is missed", async () => /Which colour has ball/.test(await current()));
  assert.equal(await page.isDisabled("#teach-undo"), true, "there is nothing older");
  await page.click("#teach-redo");
  await until("it is tracked again", async () => (await state()) === "tracking");
  assert.equal(readFileSync(taught, "utf8"), saved);
  assert.deepEqual(problems, []);
}

await run(test, { folder });
