// Calibration while the service runs, from a board that is carried in front of the cameras or from the waved object. The service
// records, huetrack-calibrate solves; the user accepts the result.
import { drawLive, follow, liveFigures } from "./cameras";
import { ask } from "./control";
import { updateHistory, whenStepped } from "./history";
import type { ControlReply } from "./messages";
import { setOptions } from "./options";
import { save } from "./save";
import { isServing, serviceOf, store } from "./store";
import { isHidden, watchVisibility } from "./visibility";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const field = (id: string) => $<HTMLInputElement>(`calibrate-${id}`);

const askEvery = 1000; // ms, while the panel is open or a calibration runs
const askRarely = 10000;
const [columns, rows] = [6, 4]; // parts of a picture (calib/gather/view_coverage.h)
const mostNeeds = 4; // most sentences at once
const remembered = "huetrack-board";

// The parameters of a board by its type: `huetrack-calibrate board --help`.
const sizes: Record<string, string[]> = {
  charuco: ["square_mm", "marker_mm"],
  chessboard: ["square_mm"],
  aruco_grid: ["marker_mm", "gap_mm"],
  april_grid: ["marker_mm", "gap_mm"],
};

interface Coverage {
  views: number;
  enoughViews: number;
  image: number; // percent of its parts with corners
  enoughImage: number;
  parts: number[]; // corners in each, row by row
  tilts: number;
  now: string; // visibility of the board
}

const panel = $("calibrate-panel");
const section = $("calibrate");
let state: Record<string, string[]> | null = null; // by key; null: unknown or not allowed
let coverage = new Map<string, Coverage>();
let needs: string[] = [];
let asked = -Infinity;
let isAsking = false;
let service = "";
let why = ""; // why nothing can be calibrated
let isSure = false; // a doubtful result was confirmed once
let isPrinting = false;

export const calibrationRefused = (): string => why;
const word = (key: string, column = 0) => state?.[key]?.[column] ?? "";
const isBusy = () => ["recording", "closing", "solving"].includes(word("state"));
const kind = () => document.querySelector<HTMLInputElement>("input[name=calibrate-kind]:checked")!.value;

function say(text: string, isBad = false): void {
  $("calibrate-says").textContent = text;
  $("calibrate-says").classList.toggle("bad", isBad);
}

async function look(): Promise<void> {
  isAsking = true;
  const asking = service;
  try {
    const reply = await ask("calibrate", "state");
    if (asking === service) take(reply);
  } finally {
    isAsking = false;
    asked = performance.now();
  }
}

function take(reply: ControlReply): void {
  why = reply.granted ? "" : reply.reason;
  const which = () => `${word("name")}/${word("state")}`; // two that end alike are two
  const before = state ? which() : "";
  state = reply.granted ? {} : null;
  coverage = new Map();
  needs = [];
  for (const [key, ...values] of reply.granted ? reply.rows : []) {
    if (key === "need") needs.push(values[0]);
    else if (key !== "coverage") state![key] = values;
    else {
      const [camera, views, enoughViews, image, enoughImage, parts, tilts, now] = values;
      coverage.set(camera, {
        views: Number(views),
        enoughViews: Number(enoughViews),
        image: Number(image),
        enoughImage: Number(enoughImage),
        parts: parts.split(",").map(Number),
        tilts: tilts.split(",").filter((n) => Number(n) > 0).length,
        now,
      });
    }
  }
  if (state && before !== which()) changed(before);
  show();
}

// Shows the result until the next action.
function changed(before: string): void {
  isSure = false;
  const says = word("says").replace(/[.?!]?$/, (end) => end || "."); // a question stays one
  const texts: Record<string, [string, boolean]> = {
    usable: [`Usable: ${says}`, false],
    doubtful: [`Doubtful: ${says}`, true],
    failed: [`It failed: ${says}`, true],
    cancelled: ["Cancelled. What was recorded is among the recordings.", false],
    accepted: [`Accepted: ${says}`, false],
  };
  const text = texts[word("state")];
  if (text && (before || word("state") !== "idle")) say(...text);
  else if (isBusy()) say("");
}

const share = (done: string, total: string) => (Number(total) > 0 ? Math.min(1, Number(done) / Number(total)) : null);

function show(): void {
  // The object needs known lenses.
  const hasRig = (store.scene?.cameras ?? []).every((c) => c.model);
  const choices = [...document.querySelectorAll<HTMLInputElement>("input[name=calibrate-kind]")];
  for (const choice of choices) choice.disabled = choice.value === "wave" && !hasRig;
  if (!hasRig) choices.find((choice) => choice.value === "board")!.checked = true;
  const now = word("state");
  const lamp = $("calibrate-lamp");
  const names: Record<string, string> = { recording: "recording", closing: "recorded", solving: "calibrating", usable: "waits to be accepted", doubtful: "waits to be looked at" };
  lamp.dataset.state = now === "recording" ? "recording" : now || "none";
  lamp.textContent = names[now] ?? "";
  $("calibrate-begin").hidden = isBusy();
  $("calibrate-run").hidden = !isBusy();
  for (const part of ["board", "wave"]) $(`calibrate-${part}`).hidden = kind() !== part;
  showSizes();
  const isRecording = now === "recording";
  const ofBoard = word("kind") === "board";
  $<HTMLButtonElement>("calibrate-stop").disabled = !isRecording;
  $("calibrate-stop").textContent = needs.length === 0 && coverage.size ? "That is enough: calibrate" : "Stop, and calibrate";
  $("calibrate-stop").classList.toggle("primary", needs.length === 0 && coverage.size > 0);
  const [step, done, total, details] = state?.progress ?? [];
  const seconds = Number(word("seconds") || NaN);
  const progress = $<HTMLProgressElement>("calibrate-progress");
  const part = step && !isRecording ? share(done, total) : null;
  if (part === null) progress.removeAttribute("value");
  else progress.value = part;
  progress.hidden = isRecording;
  $("calibrate-step").textContent = isRecording
    ? `${seconds.toFixed(0)} s: ${step && ofBoard ? step : word("says")}.`
    : step
      ? `${step}${Number(total) > 0 ? `, ${Math.round(100 * part!)} %` : ""}${details ? ` (${details})` : ""}`
      : word("says");
  $("calibrate-needs").replaceChildren(...(isRecording ? needs.slice(0, mostNeeds) : []).map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  $("calibrate-enough").hidden = !(isRecording && coverage.size > 0 && needs.length === 0);
  const isResult = now === "usable" || now === "doubtful";
  $("calibrate-accept").hidden = !isResult;
  $("calibrate-accept").textContent = now === "doubtful" ? (isSure ? "Yes, use it all the same" : "Use it although it is doubtful…") : "Use it: the cameras stand so";
  $("calibrate-accept").classList.toggle("primary", now === "usable");
  showDistance(now);
  $<HTMLButtonElement>("calibrate-print").disabled = isPrinting;
  $("calibrate-report").hidden = word("report") !== "true" || isBusy();
  const preRoll = Number(word("pre_roll_s"));
  $("calibrate-last").textContent = preRoll > 0 ? `Use the last ${preRoll} s` : "Use the last seconds";
  $<HTMLButtonElement>("calibrate-last").disabled = !(preRoll > 0);
  setOptions($<HTMLSelectElement>("calibrate-target"), (store.scene?.targets ?? []).map((t) => [t.name, t.name]));
  makePictures();
}

// The scale of a wave is only roughly known from the ball's size. A measured distance between two cameras sets it, before the wave
// or after a doubtful one.
function showDistance(now: string): void {
  const cameras = (store.scene?.cameras ?? []).map((c): [string, string] => [c.name, c.name]);
  const [a, b] = ["a", "b"].map((end) => $<HTMLSelectElement>(`calibrate-${end}`));
  const wasEmpty = !b.options.length;
  setOptions(a, cameras);
  setOptions(b, cameras);
  if (wasEmpty && cameras.length > 1) b.value = cameras[1][0];
  const ofWave = word("kind") === "wave";
  const isOver = ["usable", "doubtful", "failed"].includes(now);
  $("calibrate-distance").hidden = isBusy() || !(kind() === "wave" || (ofWave && isOver));
  const again = $<HTMLButtonElement>("calibrate-again");
  again.hidden = !(ofWave && isOver);
  again.disabled = distanceWords().length === 0;
}

// Empty if nothing plausible was typed.
function distanceWords(): string[] {
  const [a, b, metres] = [field("a").value, field("b").value, Number(field("metres").value)];
  return a && b && a !== b && metres > 0 ? [`camera_distance=${a},${b},${metres}`] : [];
}

// The board that is described, as a PDF of true size.
async function print(): Promise<void> {
  isPrinting = true;
  show();
  const words = [...boardWords(), `paper=${field("paper").value}`];
  try {
    const query = words.map((text) => text.split("=").map(encodeURIComponent).join("="));
    const answer = await fetch(`/api/board.pdf?${query.join("&")}`);
    if (!answer.ok) return say(`The board cannot be printed: ${(await answer.text()).trim()}`, true);
    save(await answer.blob(), "board.pdf");
    say("board.pdf: print it at 100 %, without fitting it to the page, measure its ruler, and glue it onto something flat.");
  } catch (error) {
    say(`The request did not go through: ${error instanceof Error ? error.message : error}`, true);
  } finally {
    isPrinting = false;
    show();
  }
}

function showSizes(): void {
  const wanted = sizes[field("type").value];
  for (const name of ["square_mm", "marker_mm", "gap_mm"]) field(name).closest("label")!.hidden = !wanted.includes(name);
}

function makePictures(): void {
  const names = isBusy() && word("state") === "recording" && !panel.hidden ? (store.scene?.cameras ?? []).map((c) => c.name) : [];
  const grid = $("calibrate-pictures");
  if (liveFigures(grid, names)) follow(names);
  for (const figure of grid.children as unknown as HTMLElement[]) {
    const of = coverage.get(figure.dataset.camera!);
    const text = !of
      ? ""
      : word("kind") === "wave"
        ? `${of.views} of ${of.enoughViews} pictures of it moving, in ${of.image} % of the picture (${of.enoughImage} wanted); ${of.now}`
        : `${of.views} of ${of.enoughViews} views, ${of.image} % of the picture (${of.enoughImage} wanted), ${of.tilts} of 5 tilts; ${of.now}`;
    figure.querySelector("span")!.textContent = text;
    figure.querySelector("canvas")!.setAttribute("aria-label", `${figure.dataset.camera}: ${text}`);
  }
  drawCalibration();
}

// Each camera's picture with the detected corners of the board, or positions of the ball.
export function drawCalibration(): void {
  if (panel.hidden) return;
  for (const figure of $("calibrate-pictures").children as unknown as HTMLElement[]) {
    const canvas = figure.querySelector("canvas")!;
    drawLive(canvas, figure.dataset.camera!);
    const parts = coverage.get(figure.dataset.camera!)?.parts;
    if (!parts) continue;
    const g = canvas.getContext("2d")!;
    const [w, h] = [canvas.width / columns, canvas.height / rows];
    for (let i = 0; i < parts.length; i++) {
      const [x, y] = [(i % columns) * w, Math.floor(i / columns) * h];
      g.fillStyle = parts[i] > 0 ? "rgb(40 200 90 / 0.3)" : "rgb(0 0 0 / 0.25)";
      g.fillRect(x, y, w, h);
      g.strokeStyle = "rgb(255 255 255 / 0.45)";
      g.lineWidth = 1;
      g.strokeRect(x + 0.5, y + 0.5, w - 1, h - 1);
    }
  }
}

async function act(...words: string[]): Promise<ControlReply> {
  for (const button of panel.querySelectorAll("button")) button.disabled = true;
  const reply = await ask("calibrate", ...words);
  for (const button of panel.querySelectorAll<HTMLButtonElement>("button:not([data-history])")) button.disabled = false;
  say(reply.reason, !reply.granted);
  void updateHistory();
  await look();
  return reply;
}

function boardWords(): string[] {
  const type = field("type").value;
  const words = [`type=${type}`, ...["columns", "rows", ...sizes[type]].filter((name) => field(name).value).map((name) => `${name}=${field(name).value}`)];
  try {
    localStorage.setItem(remembered, JSON.stringify(words));
  } catch {
    // a browser that keeps nothing
  }
  return words;
}

function recall(): void {
  try {
    for (const item of JSON.parse(localStorage.getItem(remembered) ?? "[]") as string[]) {
      const [name, value] = item.split("=");
      if (document.getElementById(`calibrate-${name}`)) field(name).value = value;
    }
  } catch {
    // of another client
  }
}

async function accept(): Promise<void> {
  const isDoubtful = word("state") === "doubtful";
  if (isDoubtful && !isSure) {
    isSure = true;
    return show();
  }
  await act("accept", ...(isDoubtful ? ["doubtful"] : []));
}

// Once a second.
export function updateCalibration(serving: boolean): void {
  const now = serving && store.scene ? serviceOf(store.scene) : "";
  if (now !== service) {
    service = now;
    state = null;
    why = "";
    asked = -Infinity;
    say("");
  }
  const isLive = serving && store.status?.mode === "run";
  const period = !panel.hidden || isBusy() ? askEvery * 0.9 : askRarely;
  if (isLive && !isAsking && performance.now() - asked >= period && !document.hidden && (!panel.hidden || isBusy() || !isHidden(section))) void look();
  $<HTMLButtonElement>("calibrate-open").disabled = panel.hidden && (!isLive || !state);
  $("calibrate-why").textContent = !serving || !store.scene ? "" : !isLive ? "A recording is not calibrated here: huetrack-calibrate does." : why;
  if (!panel.hidden) show();
}

function open(): void {
  panel.hidden = false;
  $("calibrate-open").setAttribute("aria-expanded", "true");
  void updateHistory();
  void look();
}

function close(): void {
  panel.hidden = true;
  makePictures();
  $("calibrate-open").setAttribute("aria-expanded", "false");
}

// From the first steps.
export function openCalibration(): void {
  if (isServing()) open();
  section.scrollIntoView({ behavior: "smooth", block: "start" });
}

recall();
showSizes();
$("calibrate-open").addEventListener("click", () => (panel.hidden ? open() : close()));
$("calibrate-close").addEventListener("click", () => {
  close();
  $("calibrate-open").focus();
});
for (const input of document.querySelectorAll("input[name=calibrate-kind]")) input.addEventListener("change", show);
field("type").addEventListener("change", showSizes);
$("calibrate-start").addEventListener("click", () => void act("board", ...boardWords()));
$("calibrate-last").addEventListener("click", () => void act("wave", field("target").value, ...distanceWords()));
$("calibrate-from-now").addEventListener("click", () => void act("wave", field("target").value, field("seconds").value, ...distanceWords()));
$("calibrate-again").addEventListener("click", () => void act("again", ...distanceWords()));
$("calibrate-print").addEventListener("click", () => void print());
for (const id of ["a", "b", "metres"]) field(id).addEventListener("input", show);
$("calibrate-stop").addEventListener("click", () => void act("stop"));
$("calibrate-cancel").addEventListener("click", () => void act("cancel"));
$("calibrate-accept").addEventListener("click", () => void accept());
whenStepped("calibrate", (reply) => say(reply.reason, !reply.granted));
watchVisibility(section, () => updateCalibration(isServing()));
