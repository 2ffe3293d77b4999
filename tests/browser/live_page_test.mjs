// The live page as a user has it: a real browser, a real daemon, the real bridge.
//   exit 0: passed, 77: skipped (no Chromium, no recordings), anything else: failed. Screenshots are left in --out.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { belowTheFold, openPage, openTool, options, run, say, skip, sleep, start, waiting } from "./harness.mjs";

const occlusion = join(options.data, "rendered/occlusion");
if (!existsSync(join(occlusion, "recording.yaml"))) skip(`no recording in ${occlusion}`);
const twoCams = join(options.data, "rendered/two_cams");
if (!existsSync(join(twoCams, "recording.yaml"))) skip(`no recording in ${twoCams}`);

const domain = "74";
const folder = mkdtempSync(join(tmpdir(), "huetrack-browser-"));
const until = waiting(60000);
function configuration(name, text) {
  const file = join(folder, name);
  writeFileSync(file, text);
  return file;
}
const bus = `dds: {domain: ${domain}, interfaces: [lo]}\n`;
const truthPixels = () => {
  // Where the ball is in frame 0, through the rig file: pinhole with k1 k2 p1 p2 k3.
  const rig = readFileSync(join(twoCams, "rig.yaml"), "utf8");
  const [header, row] = readFileSync(join(twoCams, "groundtruth.csv"), "utf8").split("\n");
  const value = (name) => Number(row.split(",")[header.split(",").indexOf(name)]);
  const p = [value("x"), value("y"), value("z")];
  return Object.fromEntries(
    ["cam0", "cam1"].map((camera) => {
      const part = rig.slice(rig.indexOf(`  ${camera}:`));
      const numbers = (key) => part.slice(part.indexOf(key)).match(/-?\d+(\.\d+)?(e-?\d+)?(?![\w:])/g).map(Number);
      const [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map((k) => Number(part.match(new RegExp(`${k}: ([-\\d.e]+)`))[1]));
      const d = numbers("distortion:").slice(0, 5);
      const r = numbers("rotation:").slice(0, 9);
      const t = numbers("translation:").slice(0, 3);
      const c = [0, 1, 2].map((i) => r[3 * i] * p[0] + r[3 * i + 1] * p[1] + r[3 * i + 2] * p[2] + t[i]);
      const [x, y] = [c[0] / c[2], c[1] / c[2]];
      const r2 = x * x + y * y;
      const k = 1 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 ** 3;
      return [
        camera,
        [
          fx * (x * k + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)) + cx,
          fy * (y * k + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y) + cy,
        ],
      ];
    }),
  );
};

// Texts whose contrast is below what WCAG 2.1 AA asks for (4.5:1), as "text (ratio)".
const faintTexts = () => {
  const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
  const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const rgba = (text) => [...text.match(/[\d.]+/g).map(Number), 1].slice(0, 4);
  const found = [];
  for (const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT); walker.nextNode(); ) {
    const text = walker.currentNode.data.trim();
    const element = walker.currentNode.parentElement;
    if (!text || !element.checkVisibility() || element.closest(".unseen, .skip, script, option")) continue;
    let below = element;
    while (below && rgba(getComputedStyle(below).backgroundColor)[3] === 0) below = below.parentElement;
    const [a, b] = [getComputedStyle(element).color, getComputedStyle(below ?? document.body).backgroundColor].map((c) => luminance(rgba(c)));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) found.push(`${text} (${ratio.toFixed(2)})`);
  }
  return found;
};
// What a screen reader is told: everything that can be used, and every picture, has a name.
async function checkNames(page) {
  const session = await page.context().newCDPSession(page);
  const { nodes } = await session.send("Accessibility.getFullAXTree");
  await session.detach();
  const roles = {};
  for (const node of nodes) {
    const role = node.role?.value;
    if (node.ignored || !["button", "link", "combobox", "checkbox", "application", "image", "region", "table", "alert"].includes(role)) continue;
    roles[role] = (roles[role] ?? 0) + 1;
    assert.ok(role === "table" || node.name?.value, `a ${role} without a name`);
  }
  const headings = nodes.filter((n) => !n.ignored && n.role?.value === "heading").map((n) => n.name.value);
  for (const heading of ["huetrack", "Cameras", "Scene", "Over time"])
    assert.ok(headings.includes(heading), `no heading ${heading} in ${headings}`);
  assert.ok(nodes.some((n) => n.role?.value === "main"), "no main landmark");
  return roles;
}
// Once round with Tab: what gets the focus, in order. Each shows that it has it.
async function tabStops(page) {
  await page.evaluate(() => document.querySelector(".skip").focus());
  const stops = [];
  for (let i = 0; i < 60; i++) {
    await page.keyboard.press("Tab");
    const stop = await page.evaluate(() => {
      const e = document.activeElement;
      if (!e || e === document.body) return null;
      const style = getComputedStyle(e);
      return { name: e.id || e.dataset.camera || e.className || e.tagName, ring: parseFloat(style.outlineWidth) >= 2 && style.outlineStyle !== "none" };
    });
    if (!stop || stops.some((s) => s.name === stop.name)) break;
    assert.ok(stop.ring, `no focus ring on ${stop.name}`);
    stops.push(stop);
  }
  return stops.map((s) => s.name);
}

async function test() {
  const { address, browser, page, problems } = await openPage(domain, until);
  const link = () => page.textContent("#link");
  await until("the page waits for a service", async () => (await link()) === "No service");
  say("the page is there before the daemon");

  // ---- Positions and states are those that another subscriber prints.
  await page.evaluate(() => {
    window.seen = [];
    const look = () => {
      for (const card of document.querySelectorAll("#targets li"))
        window.seen.push([card.dataset.target, card.dataset.state, card.querySelector(".position").innerText.replace(/\s+/g, " ")]);
    };
    new MutationObserver(look).observe(document.getElementById("targets"), { subtree: true, childList: true, characterData: true, attributes: true });
  });
  const watch = start(options.huetrack, "watch", "--format", "json", "--domain", domain, "--interface", "lo");
  const config = configuration("occlusion.yaml",
    `version: 1\nrig: ${occlusion}/rig.yaml\ntargets:\n  pink: {radius_m: 0.04, color: {hue_deg: [310, 355]}}\n` +
    `  lime: {radius_m: 0.04, color: {hue_deg: [65, 115]}}\nobject_tracking: {volume: {min: [-1, -1, 0.1], max: [1, 1, 2.1]}}\n${bus}`);
  // Again and again, until the page has shown enough of it: on a busy machine it shows few positions a second.
  const replay = start(options.huetrackd, "replay", config, occlusion, "--speed", "real", "--loop", "--wait-for-subscriber", "10");
  await until("the page is live", async () => (await link()) === "Replay");
  await until("three cameras show pictures", () =>
    page.evaluate(() => {
      const canvases = [...document.querySelectorAll("#cameras canvas")];
      return canvases.length === 3 && canvases.every((canvas) => {
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let low = 255, high = 0;
        for (let i = 0; i < data.length; i += 400) low = Math.min(low, data[i]), high = Math.max(high, data[i]);
        return high - low > 60;
      });
    }));
  const overWebSocket = await page.evaluate(() => new Promise((resolve, reject) => {
    const socket = new WebSocket(`ws://${location.host}/api/v1/positions`);
    socket.onerror = () => reject(new Error("no WebSocket"));
    setTimeout(() => reject(new Error("no position over a WebSocket within a minute")), 60000);
    socket.onmessage = (message) => {
      const { event, data } = JSON.parse(message.data);
      if (event !== "position") return;
      socket.close();
      resolve(data.target);
    };
  }));
  assert.ok(["pink", "lime"].includes(overWebSocket), `over a WebSocket: ${overWebSocket}`);
  await openTool(page, "teach");
  await until("why it may not be taught", async () => /allow_teach: true/.test(await page.textContent("#teach-why")));
  assert.equal(await page.isVisible("#teach-save"), false);
  await sleep(1500);
  await page.screenshot({ path: join(options.out, "occlusion.png"), fullPage: true });
  assert.deepEqual(await page.evaluate(faintTexts), []);
  say(`names for screen readers: ${JSON.stringify(await checkNames(page))}`);
  let states = [];
  await until("pink is tracked, coasts and is tracked again", async () => {
    const soFar = await page.evaluate(() => window.seen);
    const ofPink = soFar.filter(([target]) => target === "pink").map(([, state]) => state);
    states = ofPink.filter((s, i, all) => s !== all[i - 1]);
    const first = states.indexOf("coasting");
    return first > 0 && states.lastIndexOf("tracking") > first && soFar.length > 100;
  }, 120000);
  replay.child.kill("SIGINT");
  await replay.ended;
  assert.equal(replay.code, 0, replay.err);
  const seen = await page.evaluate(() => window.seen);
  watch.child.kill("SIGTERM");
  await watch.ended;
  const printed = watch.out.trim().split("\n").map((line) => JSON.parse(line));
  const key = (target, p) => `${target} ${p.map((v) => v.toFixed(3)).join(" ")}`;
  const known = new Set(printed.filter((s) => s.position[0] !== null).map((s) => key(s.target, s.position)));
  let compared = 0;
  for (const [target, , text] of seen) {
    const p = text.match(/x (-?\d+\.\d+) y (-?\d+\.\d+) z (-?\d+\.\d+)/);
    if (!p) continue; // between two changes of its three numbers, or none
    if (known.has(key(target, p.slice(1).map(Number)))) compared++;
  }
  const shown = seen.filter(([, , text]) => /x -?\d/.test(text)).length;
  assert.ok(compared > 20, `only ${compared} positions`); // some six a second, without a graphics card
  assert.ok(compared > 0.9 * shown, `${compared} of ${shown} shown positions were printed by huetrack watch`);
  say(`${compared} of ${shown} shown positions are huetrack watch's; states: ${states.join(" ")}`);

  // ---- The daemon goes and comes; the page stays.
  await until("the page says that the service is gone", async () => (await link()) === "No service");
  const late = await browser.newPage();
  await late.goto(address);
  await until("a page that comes late sees no service", async () => (await late.textContent("#link")) === "No service");
  await sleep(1500);
  assert.equal(await late.locator("#targets li").count() + (await late.locator("#cameras figure").count()), 0, "nothing of the dead one");
  await late.close();
  const teachable = configuration("teach.yaml",
    `# to be taught\nversion: 1\nrig: ${twoCams}/rig.yaml\ntargets:\n  lime:   # the ball\n    radius_m: 0.04\n` +
    `    color: {hue_deg: [200, 220]}\nobject_tracking: {volume: {min: [-1, -1, 0.1], max: [1, 1, 2.1]}}\ncontrol: {allow_teach: true}\n${bus}`);
  const hold = () => start(options.huetrackd, "replay", teachable, twoCams, "--speed", "real", "--hold",
    "--tracks", join(folder, "tracks.csv"));
  const killed = hold();
  await until("the page is live again", async () => (await link()) === "Replay");
  killed.child.kill("SIGKILL");
  await killed.ended;
  await until("the page sees that it was killed", async () => (await link()) === "No service");
  const daemon = hold();
  await until("the page has recovered", async () => (await link()) === "Replay");
  daemon.child.kill("SIGHUP");
  await until("a replay reads its configuration again", () => /reloaded .*teach.yaml/.test(daemon.err));
  say("killed and restarted: the page has recovered");

  // ---- A click teaches lime from frame 0.
  const pixels = truthPixels();
  // It was opened before, and begins by itself once it is allowed: the big pictures freeze where they are.
  await openTool(page, "teach");
  await until("both pictures are frozen", async () => (await page.locator("#cameras .frozen canvas[role=application]").count()) === 2).catch(async (error) => {
    throw new Error(`no frozen pictures; the page says: ${await page.textContent("#teach-says")}`, { cause: error });
  });
  assert.deepEqual(await belowTheFold(page, ["#cameras canvas", "#teach-save", "#teach-says", "#teach-cameras li"]), []);
  assert.equal(await page.evaluate(() => scrollY), 0);
  assert.equal(await page.isDisabled("#teach-save"), true);
  assert.match(await page.textContent("#teach-panel .tool-foot .hint"), /Save colour: click on the object/, "why it cannot be saved is said without a hover");
  assert.deepEqual(await page.evaluate(faintTexts), []);
  const frozen = (camera) => page.locator(`#cameras figure:has(b:text-is("${camera}")) canvas`);
  const at = async (camera) => {
    const box = await frozen(camera).boundingBox();
    return { x: ((pixels[camera][0] + 0.5) / 320) * box.width, y: ((pixels[camera][1] + 0.5) / 240) * box.height };
  };
  await frozen("cam0").click({ position: await at("cam0") });
  await until("the other view is suggested", async () => /probably at/.test(await page.textContent("#teach-cameras")));
  assert.equal(await page.locator("#cameras figure.large").count(), 0, "a click teaches, and does not enlarge");
  await page.screenshot({ path: join(options.out, "teach_suggested.png"), fullPage: true });
  assert.match(await page.textContent("#teach-cameras"), /Hue \d+–\d+°, saturation/);
  assert.match(await page.textContent("#teach-cameras"), /% of the background matches here/);
  // To save what one view alone taught needs to be meant.
  const untaught = readFileSync(teachable, "utf8");
  await page.click("#teach-save");
  await until("that it is not confirmed", async () => /confirm the object in cam1/.test(await page.textContent("#teach-says")));
  assert.equal(readFileSync(teachable, "utf8"), untaught);
  // As narrow as it gets: said, and not counted on.
  for (let i = 0; i < 60 && !(await page.isDisabled("#teach-narrower")); i++) {
    await page.click("#teach-narrower");
    await until("a reply", async () => (await page.getAttribute("#teach-panel", "aria-busy")) === "false");
  }
  assert.equal(await page.isDisabled("#teach-narrower"), true);
  say(`narrowed: ${await page.textContent("#teach-width")}; ${await page.textContent("#teach-cameras p")}`);
  assert.match(await page.textContent("#teach-cameras p"), /only [\d.]+ % of the object|nothing of the object/);
  await page.click("#teach-freeze");
  await until("new pictures", async () => (await page.getAttribute("#teach-panel", "aria-busy")) === "false");
  // A drag is no click.
  const frame = await frozen("cam0").boundingBox();
  await page.mouse.move(frame.x + 40, frame.y + 20);
  await page.mouse.down();
  await page.mouse.move(frame.x + 40, frame.y + 90, { steps: 4 });
  await page.mouse.up();
  await sleep(300);
  assert.equal(await page.getAttribute("#teach-panel", "aria-busy"), "false");
  assert.equal(await page.isDisabled("#teach-save"), true);
  await frozen("cam0").click({ position: await at("cam0") });
  await until("the other view is suggested again", async () => /probably at/.test(await page.textContent("#teach-cameras")));
  // The second one with the keyboard alone, from the middle of the picture.
  const canvas = frozen("cam1");
  await canvas.focus();
  const steps = [Math.round(pixels.cam1[0]) - 160, Math.round(pixels.cam1[1]) - 120];
  for (const [n, less, more] of [[steps[0], "ArrowLeft", "ArrowRight"], [steps[1], "ArrowUp", "ArrowDown"]]) {
    for (let i = 0; i < Math.floor(Math.abs(n) / 10); i++) await page.keyboard.press(`Shift+${n < 0 ? less : more}`);
    for (let i = 0; i < Math.abs(n) % 10; i++) await page.keyboard.press(n < 0 ? less : more);
  }
  await page.keyboard.press("Enter");
  await until("both are learnt", async () => /Learnt from 2 of 2/.test(await page.textContent("#teach-says")));
  await page.screenshot({ path: join(options.out, "teach_mask.png"), fullPage: true });
  const stops = await tabStops(page);
  for (const stop of ["theme", "home", "scene", "teach-open", "teach-target", "teach-freeze", "teach-narrower",
    "teach-wider", "teach-mask", "cam0", "cam1", "magnify", "plots-open", "teach-save", "teach-resume", "teach-close"])
    assert.ok(stops.includes(stop), `${stop} is not reached with Tab: ${stops}`);
  assert.deepEqual(await page.evaluate(faintTexts), []);
  await checkNames(page);
  say(`Tab goes to ${stops.join(", ")}`);
  await page.click("#teach-save");
  await until("it is saved", async () => /^Saved: lime/.test(await page.textContent("#teach-says")));
  say(await page.textContent("#teach-says"));
  assert.equal(readFileSync(teachable, "utf8"), untaught, "the user's own file stays as it is");
  const written = readFileSync(teachable.replace(/\.yaml$/, ".taught.yaml"), "utf8");
  assert.match(written, /^# What huetrackd was taught[\s\S]*lime:[\s\S]*camera_colors:\s+cam0:\s+hue_deg: /);
  assert.equal(await page.isVisible("#teach-resume"), true, "it is still held: another target may be taught");
  await page.click("#teach-resume");
  assert.equal(await daemon.ended, 0, daemon.err);
  const compare = start(options.huetrackd, "compare", join(folder, "tracks.csv"), join(twoCams, "groundtruth.csv"));
  await compare.ended;
  say(compare.out.trim());
  const figures = compare.out.match(/locked in set (\d+).*?rms error ([\d.]+) mm.*?max ([\d.]+) mm/);
  assert.ok(figures, compare.out);
  assert.ok(Number(figures[1]) <= 4, "the first set was tracked before anything was taught; lock by the third after it");
  assert.ok(Number(figures[2]) <= 4.2, "rms of the blob on the same frames");
  assert.ok(Number(figures[3]) <= 12, "largest error");

  // ---- On a phone, in the dark.
  const phone = await browser.newPage({ viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, colorScheme: "dark" });
  await phone.goto(address);
  await until("the phone has the status", async () => (await phone.textContent("#link")) !== "Connecting");
  const again = start(options.huetrackd, "replay", config, occlusion, "--speed", "real", "--wait-for-subscriber", "10");
  await until("the phone is live", async () => (await phone.textContent("#link")) === "Replay");
  await sleep(2500);
  await phone.screenshot({ path: join(options.out, "phone_dark.png"), fullPage: true });
  assert.deepEqual(await phone.evaluate(faintTexts), []);
  const wide = await phone.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `the page is ${wide} px wide on a phone of 390`);
  again.child.kill("SIGTERM");
  await again.ended;

  // ---- A camera that is tracked, with its map.
  await phone.close();
  const desk = join(options.data, "rendered/desk");
  if (existsSync(join(desk, "recording.yaml"))) {
    const moving = configuration("desk.yaml",
      `version: 1\nrig: ${desk}/rig.yaml\ncamera_tracking: {camera: cam0, start: {rectangle: ${desk}/rectangle.csv}}\n${bus}`);
    const tracked = start(options.huetrackd, "replay", moving, desk, "--speed", "real");
    await until("the tracked camera is listed", async () =>
      (await page.getAttribute("#targets li[data-camera=cam0]", "data-state").catch(() => null)) === "tracking");
    await until("its map is there", async () => /Map: \d+ points, \d+ found/.test(await page.textContent("#targets summary")));
    await page.click("#targets summary");
    const rows = await until("its points are listed", async () => (await page.locator("#targets tbody tr").count()) || 0);
    await until("points were found", async () => /found/.test(await page.textContent("#targets tbody")));
    await sleep(2500);
    await page.screenshot({ path: join(options.out, "camera_map.png"), fullPage: true });
    await checkNames(page);
    say(`the tracked camera's map: ${await page.textContent("#targets summary")}; ${rows} rows`);
    tracked.child.kill("SIGTERM");
    await tracked.ended;
  }
  assert.deepEqual(problems, []);
}

await run(test, { folder });
