// What the tests of the page share: --name value options, Chromium (or exit status 77: skipped), waiting, programs beside it.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

export const options = {};
for (let i = 2; i + 1 < process.argv.length; i += 2) options[process.argv[i].slice(2)] = process.argv[i + 1];
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
export async function run(test, { say = console.log, folder } = {}) {
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
