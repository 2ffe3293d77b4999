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
    for (const { child, out, err } of children) console.error(`--- ${child.spawnargs.slice(0, 3).join(" ")}\n${out.slice(-600)}\n${err.slice(-1200)}`);
  } finally {
    await browser?.close();
    for (const { child } of children) child.kill("SIGKILL");
    if (code === 0 && folder) rmSync(folder, { recursive: true, force: true });
  }
  process.exit(code);
}
