// The running service, operated from the page: recordings begun, ended, saved after the fact, listed, downloaded, unpacked and
// replayed; targets' colours by sliders, their radius, new ones, other names, undone; with the real service on films in the place
// of cameras, and the real bridge.
//   exit 0: passed, 77: skipped (no Chromium), anything else: failed. Screenshots are left in --out.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { belowTheFold, closeTool, openPage, openTool, options, run, say, sleep, start, waiting } from "./harness.mjs";

const domain = "77";
const folder = mkdtempSync(join(tmpdir(), "huetrack-recordings-"));
const films = join(folder, "films"), config = join(folder, "my.yaml"), shelf = join(folder, "recordings");
const until = waiting(60000);

const write = (allows) =>
  writeFileSync(config, `version: 1
rig: ${join(films, "rig.yaml")}
targets: {lime: {color: {hue_deg: [65, 115]}}}
cameras: {cam0: {device: 0, fps: 30}, cam1: {device: 1, fps: 30}}
record: {folder: ${shelf}, pre_roll_s: 3, after_s: 0.5, on_lost: false}
control: {allow_record: ${allows}, allow_teach: true}
dds: {domain: ${domain}, interfaces: [lo]}
`);

async function test() {
  const { address, browser, page, problems } = await openPage(domain, until, { width: 1400, height: 900 });
  write(false);
  // The films are made first, with their rig.
  const maker = start(options.service, config, films, "--phases", "together", "--make", "2");
  await until("the films are made", () => maker.code !== null || /ready/.test(maker.err));
  const service = maker;
  const panel = page.locator("#recordings");
  await openTool(page, "recordings");

  // ---- Not allowed: it says so, and how it is.
  await until("why nothing is recorded", async () => /Set control: \{allow_record: true\} in .*my\.yaml/.test(await page.textContent("#recordings-why")));
  for (const id of ["record-start", "record-stop", "record-save"]) assert.equal(await page.isVisible(`#${id}`), false, id);
  assert.equal((await page.request.get(new URL("/api/recordings/any.tar", address).href)).status(), 404);
  write(true);
  service.child.kill("SIGHUP");
  await until("it may record", async () => (await page.isVisible("#record-start")) && !(await page.isDisabled("#record-start")));
  assert.equal(await page.isHidden("#recordings-why"), true);
  assert.equal(await page.textContent("#record-save"), "Save the last 3 s");
  assert.equal(await page.isHidden("#record-stop"), true);

  // ---- Begun and ended.
  await page.click("#record-start");
  await until("it records", async () => /^recording \d{8}T/.test(await page.textContent("#record-state")));
  assert.match(await page.textContent("#recordings-says"), /^Recording to /);
  assert.equal(await page.isHidden("#record-start"), true);
  await until("it is listed", async () => (await page.locator("#recordings-list tr").count()) === 1);
  assert.match(await page.textContent("#recordings-list"), /being recorded/);
  await sleep(1500);
  await panel.screenshot({ path: join(options.out, "recording.png") });
  await page.click("#record-stop");
  await until("it can be downloaded", () => page.isVisible("#recordings-list a"));
  assert.equal(await page.textContent("#record-state"), "not recording");
  const name = await page.getAttribute("#recordings-list tr", "data-recording");
  await until("it has a picture", () => page.locator("#recordings-list img").evaluate((image) => image.naturalWidth > 0));

  // ---- Downloaded, unpacked, replayed.
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#recordings-list a")]);
  assert.equal(download.suggestedFilename(), `${name}.tar`);
  const tar = join(folder, "got.tar");
  await download.saveAs(tar);
  assert.equal(await download.failure(), null);
  execFileSync("tar", ["-xf", tar, "-C", folder]);
  execFileSync("diff", ["-r", join(folder, name), join(shelf, name)]);
  const replay = start(options.huetrackd, "replay", join(folder, name, "huetrackd.yaml"), join(folder, name), "--no-dds");
  assert.equal(await replay.ended, 0, replay.err);
  assert.match(replay.out, /lime/);
  say(`downloaded and replayed: ${readdirSync(join(folder, name)).join(" ")}`);

  // ---- Saved after the fact. What is kept for that begins anew when a recording ends.
  await new Promise((resolve) => setTimeout(resolve, 3500));
  await page.click("#record-save");
  await until("that it is saved", async () => /^Saving the last [23]\.\d s, and 0\.5 more/.test(await page.textContent("#recordings-says")));
  await until("two can be downloaded", async () => (await page.locator("#recordings-list a").count()) === 2);
  const length = await page.textContent("#recordings-list tr:first-child td:nth-child(3)");
  assert.ok(parseFloat(length) > 3 && parseFloat(length) < 5, `saved: ${length}`);
  await page.screenshot({ path: join(options.out, "page.png"), fullPage: true });
  await panel.screenshot({ path: join(options.out, "recordings.png") });

  // ---- Deleted, by who means it.
  const doomed = await page.getAttribute("#recordings-list tr", "data-recording");
  page.once("dialog", (dialog) => dialog.dismiss());
  await page.click(`button[aria-label="Delete ${doomed}"]`);
  assert.equal((await page.locator("#recordings-list a").count()), 2);
  page.once("dialog", (dialog) => dialog.accept());
  await page.click(`button[aria-label="Delete ${doomed}"]`);
  await until("it is gone", async () => (await page.locator("#recordings-list a").count()) === 1);
  assert.equal(await page.textContent("#recordings-says"), `Deleted: ${doomed}.`);
  assert.deepEqual(readdirSync(shelf), [name]);

  // ---- Hostile names, and who comes from another page.
  const get = (path, headers = {}) => page.request.get(new URL(path, address).href, { headers }).then((answer) => answer.status());
  for (const path of ["..%2f..%2fetc%2fpasswd.tar", "%2e%2e.tar", ".hidden.tar", "none.tar", `${name}%00.tar`, `${name}%0d%0aX:%20y.tar`])
    assert.equal(await get(`/api/recordings/${path}`), 404, path);
  assert.equal(await get(`/api/recordings/${name}.tar`, { "Sec-Fetch-Site": "cross-site" }), 403);
  const post = (data, headers = { "Content-Type": "application/json" }) =>
    page.request.post(new URL("/api/control", address).href, { headers, data }).then((answer) => answer.status());
  for (const body of ["{", "[]", '{"words": ["record", "start"]}', '{"client":"c","number":1,"host":"h","pid":1,"words":"record"}'])
    assert.equal(await post(body), 400, body);
  assert.equal(await post("{}", { "Content-Type": "text/plain" }), 415);
  assert.equal(await post("{}", { "Content-Type": "application/json", Origin: "http://evil.example" }), 403);

  // ---- The configuration, copied.
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.click("#copy-config");
  await until("it is copied", async () => /^Copied: my\.yaml/.test(await page.textContent("#toast")));
  assert.match(await page.evaluate(() => navigator.clipboard.readText()), /^# ---- my\.yaml\nversion: 1\n[\s\S]*pre_roll_s: 3/);

  // ---- The documents.
  const help = await page.request.get(new URL("/help.html", address).href).then((answer) => answer.text());
  assert.match(help, /<article id="clients-live_view-readme-md">[\s\S]*Teach a colour/);
  assert.ok(!/href="[^#/h]/.test(help), "its links lead into itself or to the web");

  // ---- Targets by hand: the mask follows the sliders, and what is saved is tracked with.
  const state = (target) => page.getAttribute(`#targets li[data-target=${target}]`, "data-state").catch(() => "");
  const slide = (id, value) => page.locator(`#adjust-${id}`).fill(String(value));
  const shares = async () => [...(await page.textContent("#adjust-cameras")).matchAll(/cam\d\s*([\d.]+) %/g)].map((m) => Number(m[1]));
  const says = () => page.textContent("#adjust-says");
  await until("lime is tracked", async () => (await state("lime")) === "tracking");
  await openTool(page, "adjust");
  await until("the sliders stand where the colour is", async () => (await page.textContent("#adjust-hue_deg-says")) === "65 to 115°");
  await until("the ball matches, and little else", async () => (await shares()).length === 2 && (await shares()).every((s) => s > 0.05 && s < 5)).catch(async (error) => { throw new Error(await page.textContent("#adjust-cameras"), { cause: error }); });
  await page.locator("#adjust-panel").screenshot({ path: join(options.out, "adjust.png") });
  await slide("hue_deg-0", 200);
  await slide("hue_deg-1", 220);
  assert.equal(await page.textContent("#adjust-hue_deg-says"), "200 to 220°");
  assert.equal(await page.getAttribute("#adjust-swatch", "title"), "azure");
  await until("nothing matches", async () => (await shares()).length === 2 && (await shares()).every((s) => s < 0.02));
  await page.click("#adjust-reset");
  await until("as it is in force", async () => (await page.textContent("#adjust-hue_deg-says")) === "65 to 115°");
  await slide("hue_deg-0", 200);
  await slide("hue_deg-1", 220);
  await slide("radius", 55);
  await page.click("#adjust-save");
  await until("it is saved", async () => /^Saved: lime is now tracked/.test(await says()));
  await until("it is not seen any more", async () => ["searching", "lost"].includes(await state("lime")));
  assert.match(readFileSync(join(folder, "my.taught.yaml"), "utf8"), /radius_m: 0\.055[\s\S]*hue_deg: \[200, 220\]/);
  await until("the button says what it undoes",
    async () => (await page.textContent("#adjust-undo")) === "Undo: colour and radius of lime");
  await page.click("#adjust-undo");
  await until("it is undone", async () => /^Undone: colour and radius of lime; my\.taught\.yaml is as it was before the save/.test(await says()));
  await until("it is tracked again", async () => (await state("lime")) === "tracking");
  await until("there is nothing older", () => page.isHidden("#adjust-undo"));

  // A new one, taught by sliders; another name.
  await page.click("#adjust-names summary");
  assert.equal(await page.isDisabled("#adjust-add"), true);
  await page.fill("#adjust-name", "a b");
  assert.equal(await page.isDisabled("#adjust-add"), true);
  await page.fill("#adjust-name", "second");
  await page.click("#adjust-add");
  await until("it is added", async () => /^Added: second; .* The service restarts/.test(await says()));
  await until("it is there", async () => (await page.locator("#adjust-target option[value=second]").count()) === 1);
  await page.selectOption("#adjust-target", "second");
  // It has no colour: nothing is painted before one is chosen.
  await until("nothing is chosen", async () => (await page.textContent("#adjust-hue_deg-says")) === "none yet");
  assert.deepEqual(await shares(), []);
  await slide("hue_deg-0", 65);
  await slide("hue_deg-1", 115);
  await page.click("#adjust-save");
  await until("second is tracked", async () => (await state("second")) === "tracking");
  await page.fill("#adjust-name", "wand");
  await page.click("#adjust-rename");
  await until("it has another name", async () => /^Renamed: second is wand now/.test(await says())).catch(async (error) => {
    throw new Error(`${await says()}; ${await page.textContent("#adjust-names .hint")}`, { cause: error });
  });
  await until("wand is tracked", async () => (await state("wand")) === "tracking");
  await until("the last change may be undone", async () => (await page.textContent("#adjust-undo")) === "Undo: renaming of second to wand");
  assert.match(await page.getAttribute("#adjust-undo", "aria-label"), /; 3 can be undone$/);
  const checked = start(options.huetrackd, "check", config);
  assert.equal(await checked.ended, 0, checked.err);
  assert.match(checked.out, /  wand:\n    radius_m: auto[^\n]*(?<!taught\.yaml)\n    shape: \S+ +# from my\.taught\.yaml/);
  await page.screenshot({ path: join(options.out, "page_targets.png"), fullPage: true });

  // ---- The cameras' controls: what is moved is seen at once, and kept when it is saved.
  const control = (name, kind = "input") => page.locator(`#controls-list label[data-control=${name}] ${kind}`);
  const dark = async () => Number((await page.textContent("#controls-lit")).match(/^(\d+) % too dark/)?.[1] ?? NaN);
  const said = () => page.textContent("#controls-says");
  await openTool(page, "controls");
  await until("its controls are there", async () => (await control("exposure_time_absolute").count()) === 1);
  assert.match(await page.textContent("#controls-list label[data-control=exposure_time_absolute]"), /200, set by its automatic/);
  await until("its light is told", async () => (await dark()) < 20);
  await control("exposure_time_absolute").fill("20");
  await until("it is darker", async () => (await dark()) > 80);
  assert.equal(await said(), "Set, and not saved yet.");
  await page.locator("#controls-panel").screenshot({ path: join(options.out, "controls.png") });
  await control("exposure_time_absolute").fill("150");
  await until("it is bright again", async () => (await dark()) < 20);
  await control("power_line_frequency", "select").selectOption("1");
  await until("the mains are set", async () => (await said()) === "Set, and not saved yet.");
  await page.click("#controls-save");
  await until("it is kept", async () => /^Saved for camera cam0/.test(await said()));
  assert.match(readFileSync(join(folder, "my.taught.yaml"), "utf8"), /cam0:\n\s+controls:\n\s+exposure_time_absolute: 150\n\s+power_line_frequency: 1\n/);
  await closeTool(page);

  // ---- On a phone.
  const phone = await browser.newPage({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 });
  await phone.goto(address);
  await openTool(phone, "recordings");
  await until("the phone lists them", async () => (await phone.locator("#recordings-list a").count()) === 1);
  await phone.locator("#recordings").screenshot({ path: join(options.out, "phone.png") });
  const link = await phone.locator("#recordings-list a").first().boundingBox();
  assert.ok(link.x >= 0 && link.x + link.width <= 390, "what downloads it is in sight");
  await openTool(phone, "adjust");
  await until("the phone has sliders", async () => /\d to \d/.test(await phone.textContent("#adjust-hue_deg-says")));
  await phone.screenshot({ path: join(options.out, "phone_adjust.png") });
  await openTool(phone, "controls");
  await until("the phone has controls", async () => (await phone.locator("#controls-list label").count()) === 3);
  await phone.screenshot({ path: join(options.out, "phone_controls.png") });
  assert.ok((await phone.evaluate(() => document.documentElement.scrollWidth)) <= 390, "too wide");
  await openTool(phone, "calibrate");
  await phone.check("input[name=calibrate-kind][value=board]", { force: true });
  assert.deepEqual(await belowTheFold(phone, ["type", "columns", "rows", "square_mm", "marker_mm", "start"].map((name) => `#calibrate-${name}`)), []);
  await phone.screenshot({ path: join(options.out, "phone_board.png") });

  // ---- A recording instead of the cameras, and back.
  await openTool(page, "recordings");
  await until("they are listed again", async () => (await page.locator("#recordings-list a").count()) === 1);
  await page.click(`button[aria-label="Replay ${name} instead of the cameras"]`);
  await until("it is replayed", async () => (await page.isVisible("#replay-close")));
  await until("wand is tracked in it", async () => (await state("wand")) === "tracking");
  await page.click("#replay-pause");
  await until("it is paused", async () => /^paused at/.test(await page.textContent("#replay-at")));
  await page.click("#replay-close");
  await until("the cameras are back", async () => (await page.isHidden("#replay")) && (await state("wand")) === "tracking");

  // ---- The recording that was downloaded, replayed: held, stepped through, slowed down, let go on.
  service.child.kill("SIGTERM");
  assert.equal(await service.ended, 0, service.err);
  const again = start(options.huetrackd, "replay", config, join(folder, name), "--speed", "real", "--hold", "--quiet");
  await until("the replay is shown", () => page.isVisible("#replay"));
  await until("it is held", async () => (await page.textContent("#replay-pause")) === "Go on");
  const at = async () => Number((await page.textContent("#replay-at")).match(/at ([\d.]+)(?: of [\d.]+)? s/)?.[1] ?? NaN);
  const before = await at();
  assert.ok(before < 0.1, `held at ${before}`); // when each camera has shown something
  await page.click("#replay-step");
  await until("a step is made", async () => (await at()) > before);
  const stepped = await at();
  await page.click("#replay-step10");
  await until("ten steps are made", async () => (await at()) > stepped + 0.2);
  await sleep(1200);
  assert.ok((await at()) < stepped + 0.5, "it stays there");
  assert.deepEqual(await belowTheFold(page, ["#replay", "#cameras canvas", "#targets .position"]), []);
  await page.screenshot({ path: join(options.out, "replay.png") });
  const windowSize = page.viewportSize();
  await page.setViewportSize({ width: 390, height: 844 });
  const speed = await page.$eval("#replay-speed", (s) => [parseFloat(getComputedStyle(s).fontSize), s.getBoundingClientRect().width]);
  assert.ok(speed[0] >= 12 && speed[1] >= 56, `the speed can be read on a phone: ${speed}`);
  await page.screenshot({ path: join(options.out, "phone_replay.png") });
  await page.setViewportSize(windowSize);
  await page.selectOption("#replay-speed", "0.1");
  await page.click("#replay-pause");
  await until("it goes on, slowly", async () => (await page.textContent("#replay-pause")) === "Pause" && (await at()) > stepped + 0.4);
  await page.click("#replay-pause");
  await until("it is paused", async () => /^paused at/.test(await page.textContent("#replay-at")));
  await page.selectOption("#replay-speed", "max");
  await page.click("#replay-pause");
  assert.equal(await again.ended, 0, again.err);
  await until("it is over", () => page.isHidden("#replay"));
  assert.deepEqual(problems, []);
}

await run(test, { folder });
