// The first steps: cameras, exposure, calibration, colour, track; for each what is missing and how to do it. Shown until something was
// tracked for the first time, and on request.
import { openTargets } from "./adjust";
import { calibrationRefused, openCalibration } from "./calibrate";
import { decodeAwaited, lightOf, type Light } from "./cameras";
import { hasControls, isRecorded, openControls } from "./controls";
import { drawLight } from "./light";
import { lightTrouble } from "./notices";
import { setting, remember } from "./settings";
import { hide, isOpen, onTool, openTool, show } from "./shell";
import { isServing, mayChange, settled, store } from "./store";
import { openTeaching } from "./teach";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

interface Step {
  title: string;
  isDone: boolean;
  says: string; // the result, or what is missing
  how?: string; // a command, or lines of a file
  buttons?: [string, () => void][]; // the first one is what most do
}

// By default a target's pixels have an intensity of 0.1 to 0.95 (configs/huetrackd.yaml).
const mostDark = 0.5; // of a picture: more is too dark to find anything in
const mostBright = 0.1;
const goodSigma = 0.01; // m

const join = (names: string[]) => names.join(", ");
const percent = (share: number) => `${Math.round(100 * share)} %`;

function service(): Step {
  return {
    title: "Cameras",
    isDone: false,
    says: `No huetrackd was found on DDS domain ${store.pulse?.domain ?? 0}. Start it in a terminal of the computer with the cameras. The page continues by itself.`,
    how: "huetrackd setup             # finds the cameras, and starts\n\n# or write my.yaml, then: huetrackd run my.yaml\nversion: 1\nrig: none                  # not calibrated yet\ncameras: {left: {device: 0}, right: {device: 2}}\nrecord: {folder: recordings, pre_roll_s: 60}\ncontrol: {allow_teach: true, allow_record: true}",
  };
}

function cameras(): Step {
  const { status } = store;
  const bad = status!.cameras.filter((c) => c.health !== "delivering");
  const isPlayed = isRecorded();
  if (isPlayed || !bad.length) return { title: "Cameras", isDone: true, says: isPlayed ? "From a recording." : `${join(status!.cameras.map((c) => c.name))} deliver.` };
  return {
    title: "Cameras",
    isDone: false,
    says: bad.map((c) => `${c.name} is ${c.health}${c.message ? `: ${c.message}` : ""}.`).join(" ") +
      (bad.every((c) => hasControls(c.name)) ? " Check its cable, and that no other program uses it." : " Check that it is on, and its cable or address."),
    buttons: [["Health…", () => show("health")]],
  };
}

function exposure(lights: [string, Light | null][]): Step {
  const title = "Exposure";
  if (isRecorded()) return { title, isDone: true, says: "As it was recorded." };
  const awaited = lights.filter(([, light]) => !light).map(([name]) => name);
  if (awaited.length) return { title, isDone: false, says: `Waiting for the picture of ${join(awaited)}.` };
  const dark = lights.filter(([, l]) => l!.dark > mostDark);
  const bright = lights.filter(([, l]) => l!.bright > mostBright);
  const restless = lightTrouble();
  if (!dark.length && !bright.length && restless) {
    const which = restless.cameras.find(hasControls);
    const buttons: Step["buttons"] = which && mayChange() ? [[`Set up ${which}…`, () => openControls(which)]] : undefined;
    return { title, isDone: true, says: `Bright enough, but ${restless.text}${buttons ? "" : "; set it in the camera's own program"}.`, buttons };
  }
  if (!dark.length && !bright.length) return { title, isDone: true, says: "Neither too dark nor too bright." };
  const says = [
    ...dark.map(([name, l]) => `${name} is too dark: ${percent(l!.dark)} of its picture shows no colour.`),
    ...bright.map(([name, l]) => `${name} is too bright: ${percent(l!.bright)} of its picture is white.`),
  ];
  const name = (dark[0] ?? bright[0])[0];
  const how = dark.length ? "more light, a longer exposure or more gain" : "a shorter exposure or less gain";
  if (mayChange() && hasControls(name))
    return { title, isDone: false, says: `${says.join(" ")} Give it ${how}, and save.`, buttons: [[`Set up ${name}…`, () => openControls(name)]] };
  return { title, isDone: false, says: `${says.join(" ")} Give it ${how}${hasControls(name) ? `, under cameras in ${store.status!.config_file}` : ", in the camera's own program"}.` };
}

// What comes next where the cameras are calibrated by the ball: what to do, and a button for it.
function withTheBall(): [string, string, () => void] {
  const { targets } = store.scene!;
  if (!targets.length) return ["first give it a name, and its radius if you know it", "Add the ball…", openTargets];
  const taught = targets.find((t) => t.colors.length);
  if (!taught) return [`click on ${targets[0].name} in each picture, which shows its colour`, `Teach ${targets[0].name}…`, () => openTeaching(targets[0].name)];
  return [`wave ${taught.name} through the room, then throw it five times and let it bounce`, `Wave ${taught.name}…`, () => openCalibration("wave")];
}

function calibration(): Step {
  const title = "Calibration";
  const missing = store.scene!.cameras.filter((c) => !c.model).map((c) => c.name);
  if (!missing.length) return { title, isDone: true, says: store.scene!.cameras.length === 1 ? "The camera is calibrated." : `The rig has ${store.scene!.cameras.length} cameras.` };
  const nothing = `The lenses and poses of ${join(missing)} are unknown.`;
  const why = calibrationRefused();
  if (store.status!.mode === "run" && !why) {
    const [does, label, open] = withTheBall();
    return {
      title,
      isDone: false,
      says: `${nothing} The ball alone finds them: ${does}. Carry a printed board in front of the cameras instead, if you have one: that is more accurate.`,
      buttons: [[label, open], ["With a board…", () => openCalibration("board")]],
    };
  }
  return {
    title,
    isDone: false,
    says: `${nothing} ${why || "A recording is not calibrated on this page."} The tutorial under Help shows the calibration in a terminal.`,
  };
}

function color(): Step {
  const title = "Colour";
  const scene = store.scene!;
  const missing = scene.targets.filter((t) => !t.colors.length).map((t) => t.name);
  if (!scene.targets.length) return { title, isDone: false, says: "No target yet. What is its name, and what is its radius?", buttons: [["Add a target…", openTargets]] };
  if (!missing.length) return { title, isDone: true, says: `${join(scene.targets.map((t) => t.name))}: known.` };
  if (!scene.may_teach) return { title, isDone: false, says: `${join(missing)}: no colour is configured. ${scene.why_not}` };
  return { title, isDone: false, says: `What colour is ${missing[0]}? Click on it in ${scene.cameras.length === 1 ? "the picture" : "one picture, and confirm it in the others"}.`, buttons: [[`Teach ${missing[0]}…`, () => openTeaching(missing[0])]] };
}

function track(): Step {
  const title = "Track";
  const isAlone = store.scene!.cameras.length === 1;
  const found = [...store.targets.values()].filter((t) => t.latest.state === "tracking");
  const sure = found.filter((t) => (t.history.at(-1)?.sigma ?? NaN) < goodSigma);
  if (sure.length) return { title, isDone: true, says: sure.map((t) => `${t.name} is tracked, ± ${(1000 * t.history.at(-1)!.sigma).toFixed(1)} mm.`).join(" ") };
  const why = store.status!.warnings.find((w) => /^target /.test(w));
  return { title, isDone: false, says: found.length ? `It is tracked, but not certain yet${isAlone ? "" : ": let two cameras see it"}.` : `Hold the object where ${isAlone ? "the camera sees" : "two cameras see"} it. ${why ? `Now: ${why}.` : ""}` };
}

let isAuto = false; // opened by the page, which closes it once something is tracked
let hasTracked = false;

function stepsNow(): Step[] {
  const later = (title: string): Step => ({ title, isDone: false, says: "" });
  if (!isServing() || !store.status) return [service(), ...["Exposure", "Calibration", "Colour", "Track"].map(later)];
  const lights = store.status.cameras.map((c): [string, Light | null] => [c.name, lightOf(c.name)]);
  if (!store.scene) return [cameras(), exposure(lights), ...["Calibration", "Colour", "Track"].map(later)];
  return [cameras(), exposure(lights), calibration(), color(), track()];
}

// What is tracked already has come by then.
const isDue = () => !hasTracked && store.connected && performance.now() - store.connectedAt > settled && !setting("steps-closed", false);

// Once a second.
export function updateSteps(): void {
  hasTracked ||= [...store.targets.values(), ...store.trackedCameras.values()].some((t) => t.latest?.state === "tracking");
  // Shown by itself until something was tracked, unless the user has closed it or uses another tool.
  if (isDue() && !openTool()) {
    isAuto = true;
    show("steps");
  }
  if (isAuto && hasTracked && isOpen("steps")) hide();
  if (hasTracked) isAuto = false;
  if (!isOpen("steps")) return;
  decodeAwaited(); // on a phone the pictures may be out of view
  const steps = stepsNow();
  const current = steps.findIndex((s) => !s.isDone);
  const list = $("steps-list");
  const key = JSON.stringify([steps, current]);
  if (list.dataset.shown !== key) {
    list.dataset.shown = key;
    list.replaceChildren(...steps.map((step, i) => itemOf(step, i === current)));
  }
  if (store.status?.mode === "run") drawLights(list.children[1] as HTMLElement);
}

function itemOf(step: Step, isCurrent: boolean): HTMLElement {
  const item = document.createElement("li");
  item.dataset.step = step.isDone ? "done" : isCurrent ? "current" : "later";
  if (isCurrent) item.setAttribute("aria-current", "step");
  const add = (tag: string, text: string) => item.appendChild(Object.assign(document.createElement(tag), { textContent: text }));
  add("h3", step.title);
  if (step.isDone || isCurrent) add("p", step.says);
  if (isCurrent && step.how) add("pre", step.how).tabIndex = 0;
  for (const [label, act] of isCurrent || step.isDone ? (step.buttons ?? []) : []) {
    const button = add("button", label) as HTMLButtonElement;
    button.type = "button";
    if (isCurrent && !item.querySelector("button.primary")) button.className = "primary";
    button.addEventListener("click", act);
  }
  return item;
}

// A histogram of each picture's intensities.
function drawLights(item: HTMLElement): void {
  let row = item.querySelector<HTMLElement>(".lights");
  if (!row) row = item.appendChild(Object.assign(document.createElement("div"), { className: "lights" }));
  for (const camera of store.status!.cameras) {
    const light = lightOf(camera.name);
    if (!light) continue;
    let figure = row.querySelector<HTMLElement>(`figure[data-camera="${CSS.escape(camera.name)}"]`);
    if (!figure) {
      figure = document.createElement("figure");
      figure.dataset.camera = camera.name;
      figure.className = "light";
      const canvas = document.createElement("canvas");
      canvas.setAttribute("role", "img");
      figure.append(canvas, Object.assign(document.createElement("figcaption"), { textContent: camera.name }));
      row.append(figure);
    }
    drawLight(figure.querySelector("canvas")!, camera.name, light);
  }
}

onTool("steps", { opened: updateSteps });
for (const id of ["steps-open", "steps-close"])
  $(id).addEventListener("click", () => {
    remember("steps-closed", !isOpen("steps"));
    isAuto = false;
  });
