// Calibration while the service runs, from a board that is carried in front of the cameras or from the waved object. The service
// records, huetrack-calibrate solves; the user accepts the result.
import { clearLayers, setLayer, type Placed } from "./cameras";
import { ask, askAloud, say as sayIn } from "./control";
import { enable } from "./hints";
import { updateHistory, whenStepped } from "./history";
import type { ControlReply } from "./messages";
import { setOptions } from "./options";
import { save } from "./save";
import { isOpen, onTool, refuse, show as showTool } from "./shell";
import { serviceOf, store, withoutService } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const field = (id: string) => $<HTMLInputElement>(`calibrate-${id}`);

const askEvery = 1000; // ms, while the panel is open or a calibration runs
const askRarely = 10000;
const [columns, rows] = [6, 4]; // parts of a picture (calib/gather/view_coverage.h)
const mostNeeds = 4; // most sentences at once
const remembered = "huetrack-board";

// The parameters of a board by its type: `huetrack-calibrate board --help`.
// By type: what is assumed where nothing is typed (calib/program/board_command.cpp), and what its columns and rows count.
const defaults: Record<string, Record<string, string>> = {
  charuco: { columns: "7", rows: "5", square_mm: "32", marker_mm: "24" },
  chessboard: { columns: "8", rows: "5", square_mm: "25" },
  aruco_grid: { columns: "6", rows: "4", marker_mm: "32", gap_mm: "9.6" },
  april_grid: { columns: "6", rows: "4", marker_mm: "32", gap_mm: "9.6" },
};
const counted: Record<string, string> = { charuco: "squares", chessboard: "inner corners", aruco_grid: "markers", april_grid: "markers" };
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

let state: Record<string, string[]> | null = null; // by key; null: unknown or not allowed
let coverage = new Map<string, Coverage>();
let needs: string[] = [];
let asked = -Infinity;
let isAsking = false;
let service = "";
let answered = ""; // the service that the texts are of
let why = ""; // why nothing can be calibrated
let isSure = false; // a doubtful result was confirmed once
let isPrinting = false;
let isActing = false;

export const calibrationRefused = (): string => why;
const word = (key: string, column = 0) => state?.[key]?.[column] ?? "";
const isBusy = () => ["recording", "closing", "solving"].includes(word("state"));
const kind = () => document.querySelector<HTMLInputElement>("input[name=calibrate-kind]:checked")!.value;

const say = (text: string, isBad = false) => sayIn($("calibrate-says"), text, isBad);

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
  const hasRig = (store.scene?.cameras ?? []).every((c) => c.model);
  const now = word("state");
  const lamp = $("calibrate-lamp");
  const names: Record<string, string> = { recording: "recording", closing: "recorded", solving: "calibrating", usable: "usable", doubtful: "doubtful" };
  lamp.dataset.state = now === "recording" ? "recording" : now || "none";
  lamp.textContent = names[now] ?? "";
  $("calibrate-begin").hidden = isBusy();
  $("calibrate-run").hidden = !isBusy();
  for (const part of ["board", "wave"]) $(`calibrate-${part}`).hidden = kind() !== part;
  showSizes();
  const isRecording = now === "recording";
  const ofBoard = word("kind") === "board";
  const isEnough = needs.length === 0 && coverage.size > 0;
  $("calibrate-stop").textContent = isEnough ? "That is enough: calibrate" : "Stop, and calibrate";
  $("calibrate-stop").classList.toggle("primary", isEnough);
  const isBoard = kind() === "board";
  $("calibrate-from-nothing").hidden = hasRig;
  $("calibrate-from-rig").hidden = !hasRig;
  // One button is what most do next. What is missing shows while it records.
  for (const [id, isNext] of [["start", true], ["last", hasRig], ["from-now", !hasRig]] as const)
    $(`calibrate-${id}`).classList.toggle("primary", isNext && now !== "usable");
  const isShown = { start: !isBusy() && isBoard, last: !isBusy() && !isBoard, "from-now": !isBusy() && !isBoard, stop: isRecording, cancel: isBusy() };
  for (const [id, isHere] of Object.entries(isShown)) $(`calibrate-${id}`).hidden = !isHere;
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
  $("calibrate-enough").textContent = ofBoard || hasRig ? "Nothing is missing." : "Nothing is missing, once it was thrown five times.";
  $("calibrate-enough").hidden = !(isRecording && coverage.size > 0 && needs.length === 0);
  const isResult = now === "usable" || now === "doubtful";
  $("calibrate-accept").hidden = !isResult;
  $("calibrate-accept").textContent = now === "doubtful" ? (isSure ? "Yes, use it all the same" : "Use it although it is doubtful…") : "Use this calibration";
  $("calibrate-accept").classList.toggle("primary", now === "usable");
  showDistance(now);
  $("calibrate-report").hidden = word("report") !== "true" || isBusy();
  const preRoll = Number(word("pre_roll_s"));
  $("calibrate-last").textContent = preRoll > 0 ? `Use the last ${preRoll} s` : "Use the last seconds";
  const targets = store.scene?.targets ?? [];
  setOptions($<HTMLSelectElement>("calibrate-target"), targets.map((t) => [t.name, t.name]));
  const wait = isActing ? "wait for the service" : "";
  const chosen = targets.find((t) => t.name === field("target").value);
  const noTarget = !chosen ? "there is no target yet: add it under Targets" : chosen.colors.length ? "" : `${chosen.name} has no colour yet: teach it`;
  enable($("calibrate-print"), isPrinting ? "it is being made" : "");
  enable($("calibrate-last"), wait || noTarget || (preRoll > 0 ? "" : "the configuration keeps no last seconds (record: {pre_roll_s: 60})"));
  for (const id of ["start", "stop", "cancel", "accept"]) enable($(`calibrate-${id}`), wait);
  enable($("calibrate-from-now"), wait || noTarget);
  enable($("calibrate-again"), wait || (distanceWords().length ? "" : "type the measured distance"));
  listCameras();
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
  const type = field("type").value;
  const square = Number(field("square_mm").value), marker = Number(field("marker_mm").value);
  for (const name of ["columns", "rows", ...wanted]) field(name).placeholder = defaults[type][name];
  // Those that follow from another one that was typed.
  if (type === "charuco" && square > 0) field("marker_mm").placeholder = String(+(0.75 * square).toFixed(2));
  if (type.endsWith("grid") && marker > 0) field("gap_mm").placeholder = String(+(0.3 * marker).toFixed(2));
  $("calibrate-counted").textContent = `Columns and rows count ${counted[type]}. Grey values are used where nothing is typed.`;
}

// What each camera has seen: in its picture, and in words.
let overlaid = "";
function listCameras(): void {
  const names = word("state") === "recording" && isOpen("calibrate") ? (store.scene?.cameras ?? []).map((c) => c.name) : [];
  const list = $("calibrate-cameras");
  if (names.join("\n") !== overlaid) {
    overlaid = names.join("\n");
    if (!names.length) clearLayers();
    for (const name of names) setLayer(name, { paint: (on) => paintCoverage(name, on) });
    list.replaceChildren(
      ...names.map((name) => {
        const item = document.createElement("li");
        item.dataset.camera = name;
        item.innerHTML = `<b></b><span class="chip"></span><p></p>`;
        item.querySelector("b")!.textContent = name;
        return item;
      }),
    );
  }
  for (const item of list.children as unknown as HTMLElement[]) {
    const of = coverage.get(item.dataset.camera!);
    const text = !of
      ? ""
      : word("kind") === "wave"
        ? `${of.views} of ${of.enoughViews} pictures of it moving, in ${of.image} % of the picture (${of.enoughImage} wanted)`
        : `${of.views} of ${of.enoughViews} views, ${of.image} % of the picture (${of.enoughImage} wanted), ${of.tilts} of 5 tilts`;
    item.querySelector("p")!.textContent = text;
    item.querySelector(".chip")!.textContent = of?.now ?? "";
  }
}

// The parts of the picture in which corners, or the moving object, were seen.
function paintCoverage(camera: string, { g, at, scale }: Placed): void {
  const of = coverage.get(camera);
  const size = store.scene?.cameras.find((c) => c.name === camera)?.size;
  if (!of || !size) return;
  const [w, h] = [(size[0] / columns) * scale, (size[1] / rows) * scale];
  const [left, top] = at(-0.5, -0.5);
  for (let i = 0; i < of.parts.length; i++) {
    const [x, y] = [left + (i % columns) * w, top + Math.floor(i / columns) * h];
    g.fillStyle = of.parts[i] > 0 ? "rgb(40 200 90 / 0.3)" : "rgb(0 0 0 / 0.25)";
    g.fillRect(x, y, w, h);
    g.strokeStyle = "rgb(255 255 255 / 0.45)";
    g.lineWidth = 1;
    g.strokeRect(x + 0.5, y + 0.5, w - 1, h - 1);
  }
}

async function act(...words: string[]): Promise<ControlReply> {
  isActing = true;
  show();
  const reply = await askAloud($("calibrate-says"), "calibrate", ...words);
  isActing = false;
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
    if (now && now !== answered) say(""); // a verdict of another run
    answered = now || answered;
    service = now;
    state = null;
    why = "";
    asked = -Infinity;
  }
  const isLive = serving && store.status?.mode === "run";
  const period = isOpen("calibrate") || isBusy() ? askEvery * 0.9 : askRarely;
  if (isLive && !isAsking && performance.now() - asked >= period && !document.hidden) void look();
  const isRunning = isBusy() && word("state") !== "idle";
  $("calibrate-open").toggleAttribute("data-lamp", isRunning);
  refuse("calibrate", !serving || !store.scene ? withoutService() : !isLive ? "A recording is not calibrated on this page." : why);
  if (isOpen("calibrate")) show();
}

// From the first steps and the warnings.
export function openCalibration(what: "board" | "wave" | "" = ""): void {
  if (what) document.querySelector<HTMLInputElement>(`input[name=calibrate-kind][value=${what}]`)!.checked = true;
  showTool("calibrate");
}

onTool("calibrate", {
  opened: () => {
    void updateHistory();
    show();
    void look();
  },
  closed: listCameras,
});
recall();
showSizes();
for (const input of document.querySelectorAll("input[name=calibrate-kind]")) input.addEventListener("change", show);
for (const id of ["type", "square_mm", "marker_mm"]) field(id).addEventListener("input", showSizes);
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
