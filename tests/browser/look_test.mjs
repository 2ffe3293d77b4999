// What the page looks like, and what it costs, with cameras of any shape: real files of the real bridge, told by a bridge of
// the test's own what there is to see. Screenshots are left in --out.
// --page DIR: the page's files from there (node build.mjs DIR), so that who works on it needs no compiler.
//   exit 0: passed, 77: skipped (no Chromium), anything else: failed
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { join } from "node:path";

import { addressOf, belowTheFold, closeTool, launch, lookedThrough, misfits, openTool, options, run, say, sleep, startBridge, visit, waiting, windows } from "./harness.mjs";

const until = waiting(60000);

// ---- A bridge: the page's files from the real one, the events from here.
const view = options.page ? null : startBridge("75");
const pages = new Set();
const bridge = createServer(async (request, response) => {
  if (request.url.startsWith("/api/events")) {
    response.writeHead(200, { "Content-Type": "text/event-stream" });
    response.flushHeaders();
    pages.add(response);
    response.on("close", () => pages.delete(response));
    for (const text of standing.values()) response.write(text);
    return;
  }
  if (request.url.startsWith("/api/")) {
    let body = "";
    for await (const part of request) body += part;
    response.writeHead(202).end("{}");
    requests.push({ to: request.url, ...(body && JSON.parse(body)) });
    const asked = request.url === "/api/control" && JSON.parse(body);
    const rows = asked && answers[asked.words.join(" ")];
    if (rows) tell("control", { client: asked.client, number: asked.number, granted: true, reason: "", rows });
    return;
  }
  if (options.page) {
    const name = request.url === "/" ? "/index.html" : request.url;
    response.writeHead(200, { "Content-Type": name.endsWith(".js") ? "text/javascript" : name.endsWith(".css") ? "text/css" : "text/html" });
    response.end(readFileSync(join(options.page, name)));
    return;
  }
  const file = await fetch(new URL(request.url, addressOf(view)));
  response.writeHead(file.status, { "Content-Type": file.headers.get("content-type") });
  response.end(Buffer.from(await file.arrayBuffer()));
});
const answers = {}; // rows, by the words that are asked
const requests = []; // of pages
const standing = new Map(); // what a page is told first: the newest of each kind
function tell(name, message, key = "") {
  const text = `event: ${name}\ndata: ${JSON.stringify(message)}\n\n`;
  if (key) standing.set(key, text);
  for (const page of pages) page.write(text);
}

// ---- What there is to see: cameras of a size, with targets at pixels, in a room.
const who = { host: "test", pid: 7 };
const now = () => Date.now() / 1000;
const rgb = { lime: [0.6, 0.85, 0.1], pink: [0.95, 0.2, 0.6], navy: [0.1, 0.1, 0.45] };
function room(sizes, targets = ["lime", "pink", "navy"]) {
  standing.clear();
  const cameras = sizes.map((size, i) => ({
    name: `cam${i}`, size, model: "pinhole", intrinsics: [size[0], size[0], size[0] / 2, size[1] / 2],
    position: [2 * Math.cos(i * 1.6), 2 * Math.sin(i * 1.6), 1.8], orientation: [0.7, 0.2, -0.2, 0.6],
    border: [[-0.5, -0.5, 1], [0.5, -0.5, 1], [0.5, 0.5, 1], [-0.5, 0.5, 1]].flat(),
  }));
  tell("pulse", { now: now(), domain: 75, bus: "lo", publishers: 1, trouble: "" }, "pulse");
  tell("scene", { ...who, at: now(), rig_identity: "r", frame_id: "world", volume: [[-1, -1, 0], [1, 1, 2]], cameras,
    targets: targets.map((name) => ({ name, radius: 0.04, rgb: rgb[name] ?? [0.5, 0.5, 0.5], colors: [] })), ignored: [], may_teach: true, why_not: "" }, "scene");
}
function status(sizes, change = () => {}) {
  const cameras = sizes.map((_, i) => ({ name: `cam${i}`, health: "delivering", message: "", frames: 900, dropped: 0, corrupted: 0, rate_hz: 29.9, age_s: 0.01 }));
  const message = { ...who, heard: now(), version: "0.1.0", mode: "run", config_file: "my.yaml", config_identity: "c", rig_identity: "r", set_rate_hz: 29.9, sets: 900,
    incomplete_sets: 0, late_frames: 0, dropped_sets: 0, published: 900, publish_failures: 0, cameras, targets: ["lime", "pink", "navy"], warnings: [] };
  change(message);
  tell("status", message, "status");
}
function position(target, t, change = {}) {
  const phase = { lime: 0, pink: 2, navy: 4 }[target] ?? 1;
  const p = [0.6 * Math.cos(t + phase), 0.6 * Math.sin(t + phase), 1 + 0.3 * Math.sin(2 * t)];
  tell("position", { target, t, set: Math.round(30 * t), state: "tracking", position: p, velocity: [0, 0, 0], covariance: [4e-6, 0, 0, 0, 4e-6, 0, 0, 0, 9e-6], views: 2,
    confidence: 0.9, particles: 500, ess: 300, latency: 0.004, tracking_latency: 0.001,
    per_view: [0, 1].map((i) => ({ camera: `cam${i}`, delivered: true, seen: true, support: 1, residual_px: 0.2 })), ...change });
}
function preview(camera, size, jpeg, places) {
  tell("preview", { camera, t: now(), set: 1, image: size, size, jpeg, targets: places.map(([target, px, radius]) => ({ target, state: "tracking", px, radius,
    ellipse: [radius / 3, radius / 4, 0], particles: [px[0] + 1, px[1] + 1, px[0] - 2, px[1]] })) }, `preview ${camera}`);
}
// A picture with a circle in the middle and a ball at each place, as JPEG.
const drawn = (page, size, places) =>
  page.evaluate(([[w, h], balls, colors]) => {
    const canvas = Object.assign(document.createElement("canvas"), { width: w, height: h });
    const g = canvas.getContext("2d");
    const fade = g.createLinearGradient(0, 0, w, h);
    fade.addColorStop(0, "#556"), fade.addColorStop(1, "#998877");
    g.fillStyle = fade, g.fillRect(0, 0, w, h);
    g.fillStyle = "#dde";
    g.beginPath(), g.arc(w / 2, h / 2, Math.min(w, h) / 4, 0, 7), g.fill();
    for (const [name, [x, y], r] of balls) {
      g.fillStyle = `rgb(${colors[name].map((c) => 255 * c).join()})`;
      g.beginPath(), g.arc(x, y, r, 0, 7), g.fill();
    }
    return canvas.toDataURL("image/jpeg", 0.8).split(",")[1];
  }, [size, places, rgb]);

// How wide and how tall the white circle is on the screen; 0 wide as long as the camera is not shown yet.
const circle = (page, camera) =>
  page.evaluate((name) => {
    const figure = [...document.querySelectorAll("#cameras figure")].find((f) => f.querySelector("b").textContent === name);
    if (!figure) return { wide: 0 };
    const canvas = figure.querySelector("canvas");
    const { width: w, height: h } = canvas;
    const g = canvas.getContext("2d");
    const white = ([r, gr, b]) => r > 195 && gr > 195 && b > 195;
    // From the middle to both sides: words may be white, too.
    const run = (pixels, middle) => {
      const isIn = (i) => i >= 0 && 4 * i < pixels.length && white(pixels.subarray(4 * i, 4 * i + 3));
      let [from, to] = [middle, middle];
      while (isIn(from - 1)) from--;
      while (isIn(to)) to++;
      return to - from;
    };
    const wide = run(g.getImageData(0, h >> 1, w, 1).data, w >> 1), tall = run(g.getImageData(w >> 1, 0, 1, h).data, h >> 1);
    const box = canvas.getBoundingClientRect();
    return { wide: (wide * box.width) / w, tall: (tall * box.height) / h, width: box.width, height: box.height };
  }, camera);

async function shapes(address) {
  for (const [name, size, count] of [["4x3", [640, 480], 2], ["16x9", [640, 360], 2], ["portrait", [360, 640], 2], ["mixed", null, 3]]) {
    const sizes = size ? Array(count).fill(size) : [[640, 480], [640, 360], [360, 640]];
    room(sizes);
    status(sizes);
    const { page } = await visit(address);
    await until("the page listens", () => pages.size > 0);
    for (const [i, [w, h]] of sizes.entries()) {
      // Three balls that nearly touch, away from the middle row and column, which circle() reads.
      const places = [["lime", [w * 0.13, h * 0.3], 14], ["pink", [w * 0.13 + 30, h * 0.3 + 4], 14], ["navy", [w * 0.13 + 12, h * 0.3 + 30], 14]];
      preview(`cam${i}`, [w, h], await drawn(page, [w, h], places), places);
    }
    const t = now();
    for (let k = 0; k < 60; k++) for (const target of ["lime", "pink", "navy"]) position(target, t + k / 30 - 2);
    // A picture that has come is not drawn yet: it is decoded first, which takes as long as the machine is busy.
    for (const i of sizes.keys()) await until(`the picture of cam${i} is drawn`, async () => (await circle(page, `cam${i}`)).wide > 0);
    for (const [i, [w, h]] of sizes.entries()) {
      const seen = await circle(page, `cam${i}`);
      assert.ok(Math.abs(seen.width / seen.height - w / h) < 0.01 * (w / h), `${name} cam${i}: shown ${seen.width} x ${seen.height}`);
      assert.ok(Math.abs(seen.wide - seen.tall) < 4 && seen.wide > 30, `${name} cam${i}: a circle is ${seen.wide} x ${seen.tall}`);
    }
    assert.deepEqual(await belowTheFold(page, [...sizes.keys()].map((i) => `#cameras figure:nth-child(${i + 1}) canvas`)), [], name);
    await page.screenshot({ path: join(options.out, `look_${name}.png`), fullPage: true });

    // Large: a click, the wheel and a drag, and Esc.
    // The dock takes its height with the plots' first texts.
    let before = await circle(page, "cam0");
    await until(`${name}: the layout stands`, async () => {
      const was = before.wide;
      await sleep(1500);
      return Math.abs((before = await circle(page, "cam0")).wide - was) < 1;
    });
    const canvas = page.locator("#cameras canvas").first();
    await page.mouse.move(10, 10);
    await canvas.click({ position: { x: 20, y: 20 } });
    await until("it is large", async () => (await page.locator("#cameras figure.large").count()) === 1);
    // The circle once the page has drawn it as large as that; a busy machine takes its time.
    const drawnAs = (what, large) => until(`${name}: ${what}`, async () => {
      const seen = await circle(page, "cam0");
      return large(seen.wide) && seen;
    });
    const large = await drawnAs(`larger than ${before.wide}`, (wide) => wide > 1.15 * before.wide);
    assert.ok(Math.abs(large.wide - large.tall) < 6, `${name}: a large circle is ${large.wide} x ${large.tall}`);
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.wheel(0, -300);
    await drawnAs(`zoomed by the wheel from ${large.wide}`, (wide) => wide > 1.3 * large.wide);
    if (name === "16x9") await page.screenshot({ path: join(options.out, "look_zoomed.png") });
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 2000, box.y + box.height / 2, { steps: 5 });
    await page.mouse.up();
    await sleep(100);
    assert.equal(await page.locator("#cameras figure.large").count(), 1, "a drag is no click");
    await page.keyboard.press("Escape");
    await until("it is small again", async () => (await page.locator("#cameras figure.large").count()) === 0);
    await drawnAs(`again as wide as ${before.wide}`, (wide) => Math.abs(wide - before.wide) < 3);
    // With the keyboard alone.
    await page.focus("#enlarge-cam0");
    await page.keyboard.press("Enter");
    await page.keyboard.press("+");
    await drawnAs("enlarged and zoomed by keys", (wide) => wide > 1.4 * before.wide);
    await page.keyboard.press("Escape");
    await page.close();
    say(`${name}: ${before.width.toFixed(0)} x ${before.height.toFixed(0)} px, large ${large.width.toFixed(0)} x ${large.height.toFixed(0)}`);
  }
}

// The same page in windows of any shape: nothing is cut off, nothing lies on anything else, and a phone tells as much.
async function fits(address) {
  const sizes = [[640, 480], [640, 360], [360, 640]];
  Object.assign(answers, {
    "record state": [["state", "idle"], ["pre_roll_s", "30"], ["always", "false"]],
    "record list": [["20261125T101500", "1795601700", "12.4", "48000000", "3", ""], ["20261125T093000-lost", "1795599000", "31", "120000000", "1", ""]],
  });
  for (const [name, [width, height]] of Object.entries(windows)) {
    room(sizes, ["lime", "pink", "a_target_with_a_long_name"]);
    const tellStatus = () => status(sizes, (s) => {
      s.targets = ["lime", "pink", "a_target_with_a_long_name"];
      s.warnings = ["camera cam1: its exposure is automatic; colours will drift. Set exposure_time_absolute under cameras.cam1.controls"];
      Object.assign(s.cameras[1], { dropped: 12, rate_hz: 9, message: "its frames come in bursts" });
    });
    tellStatus();
    tell("camera_times", { host: who.host, pid: who.pid, cameras: sizes.map((_, i) => ({ name: `cam${i}`, latency_s: 0.012 * i, latency_sigma_s: 0.0004, readout_s: 0.02, readout_sigma_s: 0.001 })) }, "times");
    const { page, problems } = await visit(address, { width, height });
    await until("the page listens", () => pages.size > 0);
    let beats = 0;
    const beat = setInterval(() => {
      if (beats++ % 20 === 0) tellStatus();
      const t = now();
      for (const target of ["lime", "pink", "a_target_with_a_long_name"])
        position(target, t, { views: 3, per_view: [0, 1, 2].map((i) => ({ camera: `cam${i}`, delivered: true, seen: true, support: 1, residual_px: 0.2 + 0.3 * i + 0.1 * Math.sin(t + i) })) });
    }, 50);
    for (const [i, [w, h]] of sizes.entries()) {
      const places = [["lime", [w * 0.13, h * 0.3], 14], ["pink", [w * 0.7, h * 0.6], 14]];
      preview(`cam${i}`, [w, h], await drawn(page, [w, h], places), places);
    }
    await until("a target has a position", async () => /x -?\d/.test(await page.textContent("#targets")));
    // Nothing to read is below the fold, and the first steps, shown meanwhile, are gone.
    await until("one screen", async () => (await belowTheFold(page, ["#cameras canvas", "#targets .position", "#targets .state", "#scene", "#tools button", "#warnings li"])).length === 0).catch(async (error) => {
      throw new Error((await belowTheFold(page, ["#cameras canvas", "#targets .position", "#targets .state", "#scene", "#tools button", "#warnings li"])).join("\n"), { cause: error });
    });
    assert.deepEqual(await misfits(page), [], name);
    await page.screenshot({ path: join(options.out, `look_window_${name}.png`) });
    await openTool(page, "recordings");
    await until("its recordings are listed", async () => (await page.locator("#recordings-list tr").count()) === 2);
    const row = await page.locator("#recordings-list tr").first().evaluate((e) => e.innerText.replace(/\s+/g, " "));
    assert.match(row, /3 cameras/, "a number alone says nothing");
    if ((await page.getAttribute("#time", "data-closed")) === "true") await (name === "phone" ? openTool(page, "plots") : page.click("#plots-open"));
    await until("residuals of each camera", async () => /cam0 [\d.]+, cam1 [\d.]+, cam2 [\d.]+/.test(await page.getAttribute('#plots [aria-label^="Residual of each camera"]', "aria-label")));
    await until("frames of each camera", async () => /cam0 29\.9, cam1 9\.00, cam2 29\.9, sets 29\.9/.test(await page.getAttribute('#plots [aria-label^="Frames of each camera"]', "aria-label")));
    // Those below come when they are scrolled to.
    for (const i of [0, 5, 7]) {
      await page.locator("#plots figure").nth(i).scrollIntoViewIfNeeded();
      await until(`plot ${i} is drawn`, async () => (await page.locator("#plots figure").nth(i).locator("canvas").count()) === 1);
    }
    assert.equal(await page.isVisible("#facts"), false, "inner figures are a click away");
    await openTool(page, "steps");
    await until("the light of all is told", async () => (await page.locator("#steps .light").count()) === 3);
    await page.evaluate(() => document.getElementById("theme").click());
    // Each tool beside the live pictures, with what ends it in sight.
    const ends = { steps: ["#steps-close"], calibrate: ["#calibrate-close"], teach: ["#teach-target", "#teach-save", "#teach-says"], adjust: ["#adjust-target", "#adjust-save", "#adjust-hue_deg-0"],
      controls: ["#controls-close"], recordings: ["#record-start", "#recordings-list img, #recordings-list b"], health: ["#health-close"] };
    for (const [tool, needed] of Object.entries(ends)) {
      await openTool(page, tool);
      if (tool === "recordings") await until("they are listed again", async () => (await page.locator("#recordings-list tr").count()) === 2);
      await sleep(400);
      assert.deepEqual(await misfits(page), [], `${name}, ${tool}`);
      assert.deepEqual(await belowTheFold(page, ["#cameras canvas", "#tools button", ...needed.map((s) => s.split(",")[0]).filter((s) => !s.includes("img"))]), [], `${name}, ${tool}`);
      await page.screenshot({ path: join(options.out, `look_window_${name}_${tool}.png`) });
    }
    await page.evaluate(() => localStorage.clear());
    clearInterval(beat);
    assert.deepEqual(problems, []);
    await page.close();
  }
  for (const words of Object.keys(answers)) delete answers[words];
  say(`fits into windows of ${Object.values(windows).map((size) => size.join(" x ")).join(", ")}`);
}

// What is not well has a colour and a sentence; what is missing is said.
async function doubts(address) {
  const sizes = [[640, 480], [640, 480]];
  standing.clear();
  tell("pulse", { now: now(), domain: 75, bus: "lo", publishers: 0, trouble: "" }, "pulse");
  const { page } = await visit(address);
  await until("what is awaited", async () => /No huetrackd was found on DDS domain 75\. Start says how/.test(await page.textContent("#no-targets")));
  await page.screenshot({ path: join(options.out, "look_empty.png") });
  room(sizes);
  const dead = (s) => Object.assign(s.cameras[1], { rate_hz: 0, health: "delivering", age_s: 5 });
  status(sizes, dead);
  await until("a camera's picture is awaited", async () => /Waiting for its first picture/.test(await page.textContent("#cameras")));
  const t = now();
  position("lime", t, { latency: 9.8 });
  position("pink", t, { covariance: [1e-2, 0, 0, 0, 1e-2, 0, 0, 0, 1e-2], views: 1, confidence: 0.2 });
  position("navy", t, { state: "lost", position: [null, null, null], velocity: [null, null, null], covariance: Array(9).fill(null) });
  const card = (name) => page.locator(`#targets li[data-target=${name}]`);
  await until("late is said", async () => /its positions are 9\.80 s late/i.test(await card("lime").textContent()));
  assert.equal(await card("lime").locator(".latency").getAttribute("data-level"), "bad");
  assert.match(await card("lime").locator("div:has(> .latency)").getAttribute("title"), /; 1\.0 ms of it after the last byte of the pictures had arrived$/);
  // The page may draw between two messages, so each is waited for.
  await until("what is wrong with pink is said", async () =>
    /exceeds its own radius; only cam0 sees it; the cameras hardly see it\./.test(await card("pink").textContent()));
  assert.equal(await card("pink").locator(".sigma").getAttribute("data-level"), "warn");
  await until("navy is lost", async () => /lost: not seen for too long/i.test(await card("navy").textContent()));
  await until("the dead camera is said", async () => /no frame in the last seconds/.test(await page.textContent("#cameras")));
  assert.equal(await page.locator("#cameras figure .chip").nth(1).getAttribute("data-health"), "stalled");
  await page.screenshot({ path: join(options.out, "look_doubts.png") });
  position("lime", now() + 0.01, { latency: -5e8 });
  await until("another clock's latency is none", async () => (await card("lime").locator(".latency").textContent()) === "–");

  // The target to teach stays chosen when the service starts again.
  await openTool(page, "health");
  await openTool(page, "teach");
  await until("it may be taught", () => page.isVisible("#teach-target"));
  await page.selectOption("#teach-target", "pink");
  who.pid = 8;
  room(sizes);
  status(sizes);
  await sleep(1200);
  await sleep(300);
  assert.equal(await page.inputValue("#teach-target"), "pink");
  answers["record state"] = [["state", "idle"], ["pre_roll_s", "30"], ["always", "false"]];
  answers["record list"] = [];
  await openTool(page, "recordings");
  await until("an empty list is said to be empty", () => page.isVisible("#recordings-none"));
  delete answers["record state"], delete answers["record list"];
  await page.close();
  say("doubts and empty states are said");
}

// A page that begins says of nothing that it is missing before it can know.
async function begins(browser, address) {
  const sizes = [[640, 480], [640, 480]];
  room(sizes);
  status(sizes);
  const beat = setInterval(() => status(sizes), 500);
  const page = await browser.newPage({ viewport: { width: 1400, height: 900 } });
  await page.addInitScript(() => {
    window.said = [];
    const look = () => {
      const missing = document.body?.innerText.match(/No service[^.]*|No bridge|No huetrackd[^.]*|bridge does not answer/i);
      if (missing) window.said.push(missing[0]);
      requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  });
  await page.goto(address);
  await until("it is live", async () => (await page.textContent("#link")) === "Live");
  for (const tool of ["teach", "adjust", "calibrate", "recordings"]) await openTool(page, tool);
  assert.deepEqual(await page.evaluate(() => window.said), []);
  clearInterval(beat);
  await page.close();
  say("a page begins");
}

// Warnings are a line a kind, the worst first, without words of a command line; what cannot be followed is not advised.
async function notices(address) {
  const sizes = [[640, 480], [640, 480]];
  room(sizes);
  answers["camera list"] = [["cam0", "reached"], ["cam1", "not reached"]];
  const beat = setInterval(() => status(sizes, (s) => s.warnings.push(
    "the rig has not been checked for long: made 300 days ago; check it with huetrack-calibrate check",
    ...["cam0", "cam1"].map((name) => `camera ${name}: its time stamps are arrival times, and its latency is unknown: measure it with huetrack-calibrate time, or set latency_offset_s`),
    "camera cam1: the whole picture becomes 9 % brighter or darker within seconds: automatic exposure is on, or the light changes: set controls: {auto_exposure: 1, exposure_time_absolute: 100, gain: ...} (1: manual), and exposure_dynamic_framerate: 0",
    "target navy is not found: no view shows its colour",
    "the times of cam1's pictures vary by 9 ms (1 sigma), but the path of lime is smooth at even ones: they are those at which the pictures arrived: use a camera whose driver stamps its frames",
    "lime in cam1: the colour is paler than the configured one (saturation 0.53), 0.23 before the end of its range: fix white balance and exposure, teach it, or set color: {adapt: true}")), 500);
  const { page, problems } = await visit(address);
  const lines = () => page.locator("#warnings li").evaluateAll((all) => all.map((e) => e.innerText.replace(/\s+/g, " ").trim()));
  await until("three lines, and more", async () => (await lines()).length === 3 && (await page.textContent("#warnings-more")) === "3 more");
  await until("which controls are reachable is known", async () => !(await lines()).some((line) => /Set up/.test(line)));
  await page.click("#warnings-more");
  await until("all of them", async () => (await lines()).length === 6);
  const all = await lines();
  say(all.join(" | "));
  assert.ok(all.some((line) => /^cam0, cam1: no time stamps of their own.*Measure by waving…$/.test(line)), "two cameras, one line, and what the page can do");
  assert.ok(all.some((line) => /^navy is not found: no view shows its colour Teach navy…$/.test(line)), "by name");
  assert.ok(all.some((line) => /^lime in cam1: the colour is paler.*teach it Teach lime…$/.test(line)), "of a target in a camera");
  assert.ok(all.some((line) => /^cam1: the exposure is automatic.*drift$/.test(line)), "no advice for controls that are not reachable");
  assert.ok(all.findIndex((line) => /^cam1/.test(line)) < all.findIndex((line) => /^cam0/.test(line)), "the worse first");
  assert.doesNotMatch(all.join(), /huetrack-calibrate|latency_offset_s|controls:|fps/);
  await openTool(page, "steps");
  const jpeg = await drawn(page, sizes[0], []);
  for (const camera of ["cam0", "cam1"]) preview(camera, sizes[0], jpeg, []);
  await until("no step says the contrary", async () => /Bright enough, but in cam1 the exposure is automatic.*in the camera's own program/.test(await page.textContent("#steps-list")));
  await page.screenshot({ path: join(options.out, "look_notices.png") });
  await page.click("#warnings li:has-text('waving') button");
  assert.equal(await page.isVisible("#calibrate-panel"), true);
  assert.equal(await page.isChecked("input[name=calibrate-kind][value=wave]"), true);
  clearInterval(beat);
  // A camera without pictures comes first; live cameras have no file of times.
  const gone = setInterval(() => status(sizes, (s) => {
    Object.assign(s.cameras[1], { health: "absent", message: "unplugged", rate_hz: 0 });
    s.warnings.push("the time stamps of cam0 and cam1 are wrong by up to 0.50 s, by varying amounts, as the motion of lime shows: frames were dropped and not counted, or a network delays them: use cameras whose driver stamps the frames, or record, and give every frame its own time");
  }), 500);
  await until("the missing camera, first", async () => /^cam1 delivers no pictures: unplugged Health…$/.test((await lines())[0]));
  assert.match((await lines())[1], /^cam0, cam1: time stamps are wrong by up to 0.50 s.*Measure by waving…$/);
  assert.doesNotMatch((await lines())[1], /recording\.yaml|videos/);
  clearInterval(gone);
  delete answers["camera list"];
  assert.deepEqual(problems, []);
  await page.close();
  say("warnings are grouped");
}

// A request waits as long as the service lives, and its late answer is taken.
async function waits(address) {
  const size = [640, 480];
  const sizes = [size, size];
  room(sizes);
  let beat = setInterval(() => status(sizes), 500);
  const { page, problems } = await visit(address);
  await until("the page listens", () => pages.size > 0);
  const says = () => page.textContent("#teach-says");
  const asked = async (action) => until(`it asks for ${action}`, () => requests.findLast((r) => r.to === "/api/teach" && r.action === action));
  await openTool(page, "teach");
  assert.match(await says(), /^Freezing the pictures…/, "at once");
  const freeze = await asked("freeze");
  await until("it counts", async () => /^Freezing the pictures… [4-9] s$/.test(await says()));
  assert.equal(await page.locator("#teach-says.bad").count(), 0);
  const jpeg = await drawn(page, size, [["lime", [100, 100], 14]]);
  const camera = (name, change) => ({ camera: name, pointed: false, region: [null, null], region_radius: null, color: { camera: name, hue_deg: [60, 100], saturation: [0.3, 1], intensity: [0.1, 0.9] },
    background_share: 0, background_box: [], verdict: "", size, jpeg: "", mask: "", ...change });
  const answer = (request, reason, cameras) => tell("teach", { client: request.client, number: request.number, granted: true, reason, set: 1, radius: null, cameras });
  answer(freeze, "Click on the object in one picture.", [camera("cam0", { jpeg }), camera("cam1", {})]);
  await until("the late pictures are there", async () => (await page.locator("#cameras .frozen canvas[role=application]").count()) === 1);
  assert.match(await page.textContent("#teach-cameras [data-camera=cam1]"), /cam1 gave no picture at this moment/, "the missing one is named");
  await page.locator("#cameras figure:has(b:text-is('cam0')) canvas").click({ position: { x: 60, y: 60 } });
  const look = await asked("look");
  clearInterval(beat); // the service falls silent
  await until("that it may have stopped", async () => /^Nothing has come from the service for 1\d s/.test(await says()));
  answer(look, "Learnt from 1 of 2 cameras.", [camera("cam0", { pointed: true, region: [100, 100], region_radius: 14, verdict: "camera cam0: all of the object matches" })]);
  await until("what came late is taken", async () => (await says()) === "Learnt from 1 of 2 cameras.");
  beat = setInterval(() => status(sizes), 500);
  await until("and can be saved", () => page.isEnabled("#teach-save"));
  // Closed while it is saved: the answer is said all the same.
  await page.click("#teach-save");
  const apply = await asked("apply");
  await page.click("#teach-close");
  answer(apply, "Saved: lime is now tracked by this colour.", []);
  await until("the save is said", async () => /^Saved: lime/.test(await page.textContent("#toast")));
  clearInterval(beat);
  assert.deepEqual(problems, []);
  await page.close();
  say("late answers are taken");
}

// Teaching in a replay, on a phone and on a laptop, with its controls and several warnings: the pictures have the room.
async function teaching(address) {
  const sizes = Array(3).fill([640, 480]);
  answers["replay state"] = [["state", "paused"], ["speed", "0.5"], ["closes", "false"], ["position_s", "12.345"], ["length_s", "120"], ["loops", "false"], ["seeks", "true"]];
  for (const name of ["phone", "laptop"]) {
    const [width, height] = windows[name];
    room(sizes, ["lime"]);
    const beat = setInterval(() => {
      tell("pulse", { now: now(), domain: 75, bus: "lo", publishers: 1, trouble: "" }, "pulse");
      status(sizes, (s) => {
        Object.assign(s, { mode: "held", targets: ["lime"] });
        s.warnings = [
          ...["1.3 % of the picture has the colour of lime and never moves, most of it around 384, 302 (from 360, 232 to 415, 383)", "4.3 % of the picture has the colour of lime and never moves, most of it around 80, 35 (from 60, 23 to 105, 83)"]
            .map((text, i) => `cam${i + 1}: ${text}: it is ignored as long as it looks the same; an object in front of it is seen where it looks different: narrow the colour, or cover it`),
          "lime in cam1: the colour differs by 9 degrees from the configured one, 13 degrees before the end of its range: fix white balance and exposure, teach it, or set color: {adapt: true}",
          "the latency is not known yet of cam1 (+- 13 ms): positions of moving objects are less certain until it is estimated from their motion: keep moving the object"];
      });
      position("lime", now());
    }, 300);
    const { page, problems } = await visit(address, { width, height });
    const jpeg = await drawn(page, sizes[0], [["lime", [100, 100], 14]]);
    for (const i of sizes.keys()) preview(`cam${i}`, sizes[0], jpeg, []);
    const lines = () => page.locator("#warnings li").evaluateAll((all) => all.map((e) => e.innerText.replace(/\s+/g, " ").trim()));
    await until("three lines", async () => (await lines()).length === 3);
    assert.ok((await lines()).some((line) => /^cam1, cam2: a part of the picture has the colour of lime and never moves/.test(line)), "a line for two cameras has the numbers of neither");
    assert.ok(!(await lines()).some((line) => /keep moving/.test(line)), "nobody moves an object in a recording");
    await until("the replay's controls", () => page.isVisible("#replay-seek"));
    assert.equal(await page.isVisible("#replay-why"), false);
    await openTool(page, "teach");
    const freeze = await until("it asks for pictures", () => requests.findLast((r) => r.to === "/api/teach" && r.action === "freeze"));
    tell("teach", { client: freeze.client, number: freeze.number, granted: true, reason: "Click on the object in one picture. The rest is said less loudly.", set: 1, radius: null,
      cameras: sizes.map((size, i) => ({ camera: `cam${i}`, pointed: false, region: [null, null], region_radius: null, color: { camera: `cam${i}`, hue_deg: [60, 100], saturation: [0.3, 1], intensity: [0.1, 0.9] },
        background_share: 0, background_box: [], verdict: "", size, jpeg, mask: "" })) });
    await until("frozen pictures", async () => (await page.locator("#cameras .frozen canvas[role=application]").count()) === 3);
    assert.equal(await page.textContent("#teach-says b"), "Click on the object in one picture.");
    if (name === "phone") await until("a line of warnings while a tool is open", async () => (await lines()).length === 1 && /^2 more$/.test(await page.textContent("#warnings-more")));
    await sleep(400);
    assert.deepEqual(await misfits(page), [], name);
    assert.deepEqual(await belowTheFold(page, ["#cameras canvas", "#tools button", "#teach-says", "#teach-save", "#replay-pause"]), [], name);
    const widths = await page.locator("#cameras canvas").evaluateAll((all) => all.map((e) => Math.round(e.getBoundingClientRect().width)));
    say(`${name}: pictures to click into are ${widths.join(", ")} px wide`);
    assert.ok(Math.min(...widths) >= 100, `${name}: pictures to click into are ${widths} px wide`);
    await page.screenshot({ path: join(options.out, `look_teaching_${name}.png`) });
    answers["replay state"] = answers["replay state"].map(([key, value]) => [key, key === "seeks" ? "false" : value]);
    await page.click("#teach-close");
    await until("why it does not jump", async () => (await page.isHidden("#replay-seek")) && (name === "phone" || (await page.isVisible("#replay-why"))));
    answers["replay state"] = answers["replay state"].map(([key, value]) => [key, key === "seeks" ? "true" : value]);
    clearInterval(beat);
    await page.evaluate(() => localStorage.clear());
    assert.deepEqual(problems, []);
    await page.close();
  }
  delete answers["replay state"];
  say("teaching in a replay");
}

// What is there to look closer: the magnifier, plots of any time, files to take away.
async function tools(address) {
  const size = [640, 480];
  const sizes = [size, size];
  room(sizes);
  status(sizes);
  const { page, problems } = await visit(address);
  await until("the page listens", () => pages.size > 0);
  const places = [["lime", [100, 100], 14], ["pink", [500, 300], 14]];
  const jpeg = await drawn(page, size, places);
  for (const camera of ["cam0", "cam1"]) preview(camera, size, jpeg, places);
  // A patch that never moves is framed and named.
  tell("preview", { camera: "cam1", t: now(), set: 2, image: size, size, jpeg, targets: [{ target: "lime", state: "left_out", px: [null, null], radius: 0, ellipse: [null, null, null], particles: [400, 100, 460, 140] }] });
  const t = now();
  const seconds = 400;
  for (let k = 0; k < 10 * seconds; k++) for (const target of ["lime", "pink"]) position(target, t + k / 10 - seconds);
  await until("pictures", async () => (await page.locator("#cameras .awaited:visible").count()) === 0);
  await until("the patch is told", async () => /but static and ignored: from 400, 100/.test(await page.locator("#cameras canvas").nth(1).getAttribute("aria-label")));

  // The magnifier is in the corner that is farthest from all objects, and shows one in its middle.
  const pixel = (camera, x, y) => page.evaluate(([name, x, y]) => {
    const canvas = [...document.querySelectorAll("#cameras figure")].find((f) => f.querySelector("b").textContent === name).querySelector("canvas");
    return [...canvas.getContext("2d").getImageData(Math.round(x * canvas.width), Math.round(y * canvas.height), 1, 1).data].slice(0, 3);
  }, [camera, x, y]);
  const isLime = ([r, g, b]) => g > 170 && b < 90 && r > 110;
  const inset = [0.5 * 0.38 * 0.75 + 0.02, 1 - 0.5 * 0.38 + 0.02]; // beside the cross in the middle of the lower left one
  assert.ok(!isLime(await pixel("cam0", ...inset)));
  await page.selectOption("#magnify", "lime");
  await until("lime is magnified", async () => isLime(await pixel("cam0", ...inset)));
  await page.screenshot({ path: join(options.out, "look_magnified.png"), fullPage: true });
  await page.selectOption("#magnify", "");
  await until("and not any more", async () => !isLime(await pixel("cam0", ...inset)));

  // Plots: as it comes, half a minute; then ten; paused, nothing moves; the cursor tells values of then.
  const label = (i = 0) => page.locator("#plots .chart").nth(i).getAttribute("aria-label");
  const drawnPlot = () => page.evaluate(() => document.querySelector("#plots canvas").toDataURL());
  await until("half a minute is shown", async () => /over the last 30 seconds/.test(await label()));
  await page.selectOption("#plot-span", "600");
  await until("ten minutes are shown", async () => /over the last 600 seconds/.test(await label()));
  await page.click("#plot-pause");
  // What was asked for before is drawn soon, on a busy machine later.
  let before = "";
  await until("the paused plot stands", async () => {
    const was = before;
    await sleep(700);
    return (before = await drawnPlot()) === was;
  });
  for (let k = 1; k < 30; k++) position("lime", now() + k / 1000, { position: [5, 5, 5] });
  await sleep(1500);
  assert.ok((await drawnPlot()) === before, "a paused plot changes");
  await page.screenshot({ path: join(options.out, "look_paused.png"), fullPage: true });
  await page.click("#plot-pause");
  await until("it goes on", async () => (await drawnPlot()) !== before);
  await page.selectOption("#plot-span", "10");
  const fresh = now();
  for (let k = 0; k < 120; k++) position("lime", fresh + (k - 119) / 10 + 0.1);
  await until("they are shown", async () => /over the last 10 seconds/.test(await label()));
  await page.click("#plot-pause");
  const plot = page.locator("#plots .chart").first();
  await plot.scrollIntoViewIfNeeded();
  const box = await plot.boundingBox();
  await page.mouse.move(box.x + 46 + (box.width - 56) * 0.1, box.y + 40);
  await until("the cursor says when", async () => /at −(8\.9|9\.0)\d s/.test(await page.textContent("#plot-cursor")));
  await page.screenshot({ path: join(options.out, "look_cursor.png") });
  const said = (await label()).match(/lime x (-?[\d.]+), lime y (-?[\d.]+), lime z (-?[\d.]+)/).slice(1).map(Number);
  const at = Number((await page.textContent("#plot-cursor")).match(/[\d.]+/)[0]);
  await page.mouse.move(5, 5);
  await until("and goes", async () => (await page.textContent("#plot-cursor")) === "");
  const download = async (button) => {
    const [file] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
    return { name: file.suggestedFilename(), content: readFileSync(await file.path()) };
  };
  const csv = await download("#plot-csv");
  assert.equal(csv.name, "huetrack.csv");
  const [head, ...rows] = csv.content.toString().trim().split("\n");
  assert.equal(head, "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence");
  const lime = rows.map((row) => row.split(",")).filter((row) => row[0] === "lime");
  const times = lime.map((row) => Number(row[1]));
  const last = times[times.length - 1];
  // All of the ten seconds before the pause; on a busy machine the last sample is seconds older than that.
  assert.ok(lime.length > 20 && lime.length <= 102 && last - times[0] <= 10.01 && lime.length > 9.8 * (last - times[0]),
    `${lime.length} rows over ${last - times[0]} s`);
  // What the cursor said is what stands in the file for then. The plots end when they were paused, on a busy machine some time
  // after the last sample; they begin 10 s before that, with one that is at most a tenth of a second later.
  const then = times[0] + 9.95 - at;
  const near = lime.reduce((a, b) => (Math.abs(Number(b[1]) - then) < Math.abs(Number(a[1]) - then) ? b : a));
  said.forEach((v, i) => assert.ok(Math.abs(v - Number(near[2 + i])) < 0.15, `the cursor says ${said}, the file ${near.slice(2, 5)}`));
  for (const [button, name] of [["#plot-png", "huetrack-plots.png"], ["#cameras .keep", "cam0-1.png"]]) {
    const picture = await download(button);
    assert.equal(picture.name, name);
    assert.equal(picture.content.subarray(1, 4).toString(), "PNG");
    assert.ok(picture.content.length > 3000);
  }
  assert.deepEqual(problems, []);
  await page.close();
  say("magnifier, plots, files");
}

// The first steps say at each what is missing, and go when something is tracked.
async function steps(address) {
  const size = [640, 480];
  const sizes = [size, size];
  standing.clear();
  tell("pulse", { now: now(), domain: 75, bus: "lo", publishers: 0, trouble: "" }, "pulse");
  const { page } = await visit(address);
  const current = () => page.textContent("#steps-list [data-step=current]");
  const keep = (name) => page.screenshot({ path: join(options.out, `look_steps_${name}.png`) });
  await until("no service", async () => /Cameras.*No huetrackd was found.*rig: none/s.test(await current()));
  await keep("1_service");
  // A service that is silent for four seconds counts as gone.
  let change = () => {};
  const tellStatus = (how = () => {}) => ((change = how), status(sizes, how));
  const beat = setInterval(() => status(sizes, (s) => change(s)), 1000);
  room(sizes);
  const scene = JSON.parse(standing.get("scene").match(/data: (.*)\n/)[1]);
  const tellScene = () => tell("scene", scene, "scene");
  scene.cameras.forEach((c) => Object.assign(c, { model: "", intrinsics: [0, 0, 0, 0], position: [0, 0, 0], border: [] }));
  scene.targets = scene.targets.slice(0, 1);
  tellScene();
  tellStatus((s) => Object.assign(s.cameras[1], { health: "absent", message: "unplugged" }));
  await until("a camera is missing", async () => /cam1 is absent: unplugged.*Check its cable/.test(await current()));
  await keep("2_cameras");
  tellStatus();
  await until("pictures are awaited", async () => /Exposure.*Waiting for the picture of cam0, cam1/.test(await current()));
  const even = (page, level) => page.evaluate((level) => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
    const g = canvas.getContext("2d");
    const fade = g.createLinearGradient(0, 0, 640, 0);
    fade.addColorStop(0, `rgb(${level[0]} ${level[0]} ${level[0]})`), fade.addColorStop(1, `rgb(${level[1]} ${level[1]} ${level[1]})`);
    g.fillStyle = fade, g.fillRect(0, 0, 640, 480);
    return canvas.toDataURL("image/jpeg", 0.9).split(",")[1];
  }, level);
  preview("cam0", size, await even(page, [0, 30]), []);
  preview("cam1", size, await even(page, [60, 200]), []);
  await until("too dark", async () => /cam0 is too dark: [78]\d % of its picture shows no colour.*Set up cam0/s.test(await current()));
  await until("the light of both is shown", async () => (await page.locator("#steps .light").count()) === 2);
  preview("cam0", size, await even(page, [200, 255]), []);
  await until("too bright", async () => /cam0 is too bright: 2\d % of its picture is white/.test(await current()));
  await keep("3_exposure");
  preview("cam0", size, await even(page, [60, 200]), []);
  await until("not calibrated", async () => /Calibration.*lenses and poses of cam0, cam1 are unknown.*Carry a printed board/s.test(await current()));
  await keep("4_calibration");
  room(sizes);
  const known = JSON.parse(standing.get("scene").match(/data: (.*)\n/)[1]);
  scene.cameras = known.cameras;
  Object.assign(scene, { may_teach: false, why_not: "Set control: {allow_teach: true}." });
  tellScene();
  await until("may not be taught", async () => /Colour.*lime: no colour is configured\. Set control/.test(await current()));
  Object.assign(scene, { may_teach: true, why_not: "" });
  tellScene();
  await until("to be taught", async () => /What colour is lime/.test(await current()));
  await keep("5_colour");
  await page.click("#steps-list [data-step=current] button");
  assert.equal(await page.isVisible("#teach-panel"), true);
  await page.click("#teach-close");
  scene.targets[0].colors = [{ camera: "cam0", hue_deg: [60, 100], saturation: [0.3, 1], intensity: [0.1, 0.95] }];
  tellScene();
  tellStatus((s) => s.warnings.push("target lime is not found: no view shows its colour"));
  await until("to be found", async () => /Track.*Now: target lime is not found/.test(await current()));
  await keep("6_track");
  position("lime", now());
  await until("they go", () => page.isHidden("#steps"));
  await page.click("#steps-open");
  await until("and come when they are asked for", async () => (await page.locator("#steps-list [data-step=done]").count()) === 5);
  assert.match(await page.textContent("#steps-list"), /lime is tracked, ± 3\.0 mm/);
  await keep("7_done");
  await page.click("#steps-close");
  assert.equal(await page.isHidden("#steps"), true);
  clearInterval(beat);
  await page.close();
  say("first steps");
}

// CPU seconds of all of Chromium's processes.
async function cpu(browser) {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  await session.detach();
  return processInfo.reduce((sum, p) => sum + p.cpuTime, 0);
}
// What a page costs while nothing happens and while it runs. How many per cent of a core that is depends on the core and on who
// else is on it, so it is told; how often the page draws, and which canvases, is the page's own doing, and is held.
async function costs(browser, address) {
  const sizes = [[480, 360], [480, 360], [480, 360]]; // previews as wide, and as many, as the service makes by default
  room(sizes);
  status(sizes);
  const { page } = await visit(address);
  await page.evaluate(() => {
    window.drawn = { frames: 0, pictures: 0 };
    const ask = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = (draw) => (window.drawn.frames++, ask(draw));
    const draw = CanvasRenderingContext2D.prototype.drawImage;
    CanvasRenderingContext2D.prototype.drawImage = function (...all) {
      window.drawn.pictures++;
      return draw.apply(this, all);
    };
  });
  await until("the page listens", () => pages.size > 0);
  const over = async (seconds, each) => {
    const [from, at, before] = [await cpu(browser), Date.now(), await page.evaluate(() => ({ ...window.drawn }))];
    for (let k = 0; Date.now() < at + 1000 * seconds; k++) {
      each?.(k);
      await sleep(33 - ((Date.now() - at) % 33));
    }
    const after = await page.evaluate(() => window.drawn);
    const passed = (Date.now() - at) / 1000;
    return { percent: (100 * ((await cpu(browser)) - from)) / passed, frames: (after.frames - before.frames) / passed,
      pictures: (after.pictures - before.pictures) / passed };
  };
  const beat = (k) => k % 30 === 0 && (tell("pulse", { now: now(), domain: 75, bus: "lo", publishers: 1, trouble: "" }, "pulse"), status(sizes));
  await over(4, beat); // the browser still compiles what it has just loaded
  await page.evaluate(() => {
    window.drawn.rewritten = [];
    new MutationObserver((all) => {
      for (const { target, addedNodes, removedNodes } of all)
        if (addedNodes.length === 1 && removedNodes.length === 1 && addedNodes[0].nodeType === 3 && addedNodes[0].data === removedNodes[0].data)
          window.drawn.rewritten.push(target.id || target.className || target.tagName);
    }).observe(document.body, { subtree: true, childList: true });
  });
  const idle = await over(5, beat);
  idle.rewritten = await page.evaluate(() => window.drawn.rewritten);
  const places = [["lime", [200, 200], 14], ["pink", [400, 240], 14]];
  const jpegs = [await drawn(page, sizes[0], places), await drawn(page, sizes[0], [["lime", [220, 210], 14], ["pink", [390, 250], 14]])];
  const run = (k) => {
    beat(k);
    for (const target of ["lime", "pink"]) position(target, now());
    if (k % 4 === 0) sizes.forEach((size, i) => preview(`cam${i}`, size, jpegs[(k / 4) % 2], places));
  };
  await over(2, run);
  const running = await over(5, run);
  await page.screenshot({ path: join(options.out, "look_running.png") });
  await page.close();
  for (const [what, seen] of Object.entries({ idle, running }))
    say(`${what}: ${seen.percent.toFixed(1)} % of a core (all of Chromium's processes, without a graphics card), ` +
      `${seen.frames.toFixed(1)} frames and ${seen.pictures.toFixed(1)} pictures drawn a second`);
  return { idle, running };
}

async function test() {
  await until("the bridge says its address", () => options.page || addressOf(view));
  await new Promise((resolve) => bridge.listen(0, "127.0.0.1", resolve));
  const address = `http://127.0.0.1:${bridge.address().port}/`;
  const browser = await launch();
  const what = (options.only ?? "begins,shapes,fits,doubts,notices,waits,teaching,tools,steps,costs").split(",");
  if (what.includes("begins")) await begins(browser, address);
  if (what.includes("shapes")) await shapes(address);
  if (what.includes("fits")) await fits(address);
  if (what.includes("doubts")) await doubts(address);
  if (what.includes("notices")) await notices(address);
  if (what.includes("waits")) await waits(address);
  if (what.includes("teaching")) await teaching(address);
  if (what.includes("tools")) await tools(address);
  if (what.includes("steps")) await steps(address);
  if (what.includes("costs")) {
    const { idle, running } = await costs(browser, address);
    // Nothing new but a status a second: no picture is drawn again, and hardly anything else.
    assert.ok(idle.pictures === 0 && idle.frames < 4, `an idle page draws ${idle.frames} frames and ${idle.pictures} pictures a second`);
    assert.deepEqual(idle.rewritten, [], "an idle page writes texts that stand there already");
    // Positions come 30 times a second, and three pictures 7.5 times; what comes together is drawn together.
    assert.ok(running.frames < 36, `a running page draws ${running.frames} frames a second`);
    assert.ok(running.pictures > 1 && running.pictures < 100, `a running page draws ${running.pictures} pictures a second`);
  }
}

await run(test);
