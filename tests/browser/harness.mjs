// What the tests of the page share: --name value options, the folder --out for screenshots, Chromium (or exit status 77: skipped),
// waiting, programs beside it, and the page as a user first has it.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdirSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

export const options = {};
for (let i = 2; i + 1 < process.argv.length; i += 2) options[process.argv[i].slice(2)] = process.argv[i + 1];
mkdirSync(options.out, { recursive: true });
const begun = Date.now();
export const say = (text) => console.log(`${((Date.now() - begun) / 1000).toFixed(1)} s: ${text}`);
export const skip = (why) => {
  console.log(`skipped: ${why}`);
  process.exit(77);
};
const chromiumPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].find(existsSync);
if (!chromiumPath) skip("there is no /usr/bin/chromium");
if (!existsSync(join(options.modules, "node_modules/playwright-core"))) skip("playwright-core is not installed");
const { chromium } = createRequire(join(options.modules, "package.json"))("playwright-core");
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

let browser;
export async function launch() {
  browser = await chromium.launch({
    executablePath: chromiumPath,
    args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
      "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"],
  });
  return browser;
}

// A page of that browser at the address, and what is wrong with it so far: what it has thrown, and whom it asks besides its bridge.
export async function visit(address, viewport = { width: 1440, height: 1000 }) {
  const page = await browser.newPage({ viewport });
  const problems = [];
  page.on("pageerror", (error) => problems.push(error.message));
  page.on("request", (request) => [address, "data:", "blob:"].some((own) => request.url().startsWith(own)) ||
    problems.push(`it asks ${request.url()}`));
  await page.goto(address);
  return { page, problems };
}

// The bridge of `huetrack view`, on a domain of the test's own.
export const startBridge = (domain) => start(options.huetrack, "view", "--port", "0", "--domain", domain, "--interface", "lo");
export const addressOf = (bridge) => bridge.out.match(/http:\S+/)?.[0];
// How a test begins: a bridge, the browser, and its page.
export async function openPage(domain, until, viewport) {
  const view = startBridge(domain);
  const address = await until("the bridge says its address", () => addressOf(view));
  const browser = await launch();
  return { view, address, browser, ...(await visit(address, viewport)) };
}

// Opens a tool, or leaves it open. On a phone some stand under More.
export async function openTool(page, tool) {
  if (!(await page.isVisible(`#${tool}-open`))) {
    await openTool(page, "more");
    await page.click(`[data-goto=${tool}]`);
  } else if ((await page.getAttribute(`#${tool}-open`, "aria-expanded")) !== "true") await page.click(`#${tool}-open`);
}
export async function closeTool(page) {
  const close = page.locator("#drawer .tool:not([hidden]) .close");
  if (await close.count()) await close.click();
}

// What of these is not in the window as a whole, without scrolling: neither the page nor anything in it.
export const belowTheFold = (page, selectors) => page.evaluate((selectors) => {
  const found = [];
  if (document.documentElement.scrollHeight > innerHeight) found.push(`the page is ${document.documentElement.scrollHeight} px tall in a window of ${innerHeight}`);
  for (const selector of selectors) {
    const all = [...document.querySelectorAll(selector)].filter((e) => e.checkVisibility());
    if (!all.length) found.push(`${selector} is not shown`);
    for (const e of all) {
      const r = e.getBoundingClientRect();
      let box = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };
      for (let around = e.parentElement; around; around = around.parentElement) {
        if (getComputedStyle(around).overflowY === "visible") continue;
        const b = around.getBoundingClientRect();
        box = { left: Math.max(box.left, b.left), top: Math.max(box.top, b.top), right: Math.min(box.right, b.right), bottom: Math.min(box.bottom, b.bottom) };
      }
      if (r.width < 1 || r.height < 1 || r.left < box.left - 2 || r.top < box.top - 2 || r.right > box.right + 2 || r.bottom > box.bottom + 2)
        found.push(`${selector}: ${[r.left, r.top, r.right, r.bottom].map(Math.round)} in ${[box.left, box.top, box.right, box.bottom].map(Math.round)}`);
    }
  }
  return found;
}, selectors);

// What does not fit into the page as it is: wider than the window, cut off, or one thing that is read or used on another.
// A note on a picture lies on it.
export const misfits = (page) => page.evaluate(() => {
  const found = [];
  const of = (e) => `${e.tagName.toLowerCase()}${e.id ? `#${e.id}` : ""} "${(e.textContent || e.getAttribute("aria-label") || "").trim().slice(0, 40)}"`;
  const wide = document.documentElement.scrollWidth, window = document.documentElement.clientWidth;
  if (wide > window) found.push(`the page is ${wide} px wide in a window of ${window}`);
  const boxes = [];
  for (const e of document.querySelectorAll("button, select, input, summary, a, canvas, h2, h3, p, dd, dt, b, li, label, figcaption, .about, .key, .chip, .small")) {
    if (!e.checkVisibility() || e.closest(".unseen, .skip, .awaited, .camera .note, .edge")) continue;
    const scrolls = e.closest(".scroll, pre, .tool-body, .time-body, #cameras, #targets, #notices");
    // Of what scrolls in a box of its own only what the box shows.
    const own = e.getBoundingClientRect(), box = scrolls?.getBoundingClientRect() ?? own;
    const r = { left: Math.max(own.left, box.left), right: Math.min(own.right, box.right), top: Math.max(own.top, box.top), bottom: Math.min(own.bottom, box.bottom) };
    if (r.right - r.left < 1 || r.bottom - r.top < 1) continue;
    if (!scrolls && (r.left < -1 || r.right > window + 1)) found.push(`${of(e)} reaches from ${r.left} to ${r.right} in a window of ${window}`);
    // Text that is wider than its box is cut off, or lies on what is beside it.
    if (!scrolls && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0 && !["INPUT", "SELECT", "CANVAS"].includes(e.tagName)) found.push(`${of(e)} needs ${e.scrollWidth} px and has ${e.clientWidth}`);
    if (!e.querySelector("*") || ["BUTTON", "SELECT", "LABEL"].includes(e.tagName)) boxes.push([e, r]);
  }
  for (const [i, [a, p]] of boxes.entries())
    for (const [b, q] of boxes.slice(i + 1)) {
      if (a.contains(b) || b.contains(a)) continue;
      const [w, h] = [Math.min(p.right, q.right) - Math.max(p.left, q.left), Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top)];
      if (w > 2 && h > 2) found.push(`${of(a)} and ${of(b)} lie on each other, by ${w.toFixed(0)} x ${h.toFixed(0)} px`);
    }
  return found;
});
// Windows that people have: 4:3, 16:9, a screen on its side, a phone.
export const windows = { "4x3": [1280, 960], "16x9": [1920, 1080], laptop: [1400, 900], portrait: [1080, 1920], phone: [390, 844] };

// Scrolled through once, as what nobody has seen is not drawn, and back.
export async function lookedThrough(page) {
  const [height, tall, at] = await page.evaluate(() => [innerHeight, document.documentElement.scrollHeight, scrollY]);
  for (let top = 0; top < tall; top += height) {
    await page.evaluate((top) => scrollTo(0, top), top);
    await sleep(200);
  }
  await page.evaluate((top) => scrollTo(0, top), at);
  await sleep(200);
}

// The page as it is, looked at in each of these windows: nothing misfits, nothing that is needed is below the fold, and a picture of
// it is left in --out.
export async function lookAt(page, name) {
  const usual = page.viewportSize();
  for (const [window, [width, height]] of Object.entries(windows)) {
    await page.setViewportSize({ width, height });
    await lookedThrough(page);
    assert.deepEqual(await misfits(page), [], `${name} in a window of ${width} x ${height}`);
    // What is needed to teach, to calibrate, and to read a position, as far as it is shown now.
    const needed = [];
    for (const part of ["#tools button", "#cameras canvas", "#targets .position", "#targets .state", ".tool-foot button"])
      if (await page.locator(`${part}:visible`).count()) needed.push(part);
    assert.deepEqual(await belowTheFold(page, needed), [], `${name} in a window of ${width} x ${height}`);
    await page.screenshot({ path: join(options.out, `${name}_${window}.png`), fullPage: true });
  }
  await page.setViewportSize(usual);
}

// A program that ends with the test; what it prints is kept, and its exit status once it has ended.
const children = [];
export const start = (program, ...args) => startWith({}, program, ...args);
// environment: added to ours
export function startWith(environment, program, ...args) {
  const child = spawn(program, args, { stdio: ["ignore", "pipe", "pipe"], env: { ...globalThis.process.env, ...environment } });
  const process = { child, out: "", err: "", code: null };
  child.stdout.on("data", (data) => (process.out += data));
  child.stderr.on("data", (data) => (process.err += data));
  process.ended = new Promise((resolve) => child.on("close", (code) => resolve((process.code = code ?? -1))));
  children.push(process);
  return process;
}

// The test's end is the process'. Of one that fails the programs' last words are told, and its scratch folder stays.
export async function run(test, { folder } = {}) {
  let code = 1;
  try {
    await test();
    code = 0;
    say("passed");
  } catch (error) {
    console.error(error);
    for (const [i, page] of (browser?.contexts() ?? []).flatMap((context) => context.pages()).entries()) {
      await page.screenshot({ path: join(options.out, `failed_${i}.png`) }).catch(console.error);
      console.error(`--- page ${i}: ${await page.evaluate(() => document.body.innerText.replace(/\s+/g, " ").slice(0, 3000)).catch(String)}`);
    }
    for (const { child, out, err } of children) console.error(`--- ${child.spawnargs.slice(0, 3).join(" ")}\n${out.slice(-600)}\n${err.slice(-1200)}`);
  } finally {
    await browser?.close();
    for (const { child } of children) child.kill("SIGKILL");
    if (code === 0 && folder) rmSync(folder, { recursive: true, force: true });
  }
  process.exit(code);
}
