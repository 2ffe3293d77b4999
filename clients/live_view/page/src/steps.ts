// The first steps: cameras, exposure, calibration, colour, track; for each what is missing and how to do it. Shown until something was
// tracked for the first time, and on request.
import { openTargets } from "./adjust";
import { calibrationRefused, openCalibration } from "./calibrate";
import { decodeAwaited, lightOf, type Light } from "./cameras";
import { openControls } from "./controls";
import { drawLight } from "./light";
import { isServing, mayChange, store } from "./store";
import { openTeaching } from "./teach";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

interface Step {
  title: string;
  isDone: boolean;
  says: string; // the result, or what is missing
  how?: string; // a command, or lines of a file
  button?: [string, () => void];
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
    says: `No huetrackd was found on DDS domain ${store.pulse?.domain ?? 0}. On the computer with the cameras, huetrackd setup finds them and starts; huetrackd doctor explains why it leaves one out. Or write the file yourself:`,
    how: "huetrackd setup\n\n# or my.yaml, started with huetrackd run my.yaml\nversion: 1\nrig: none                  # not calibrated yet\ncameras: {left: {device: 0}, right: {device: 2}}\nrecord: {folder: recordings, pre_roll_s: 60}\ncontrol: {allow_teach: true, allow_record: true}",
  };
}

function cameras(): Step {
  const { status } = store;
  const bad = status!.cameras.filter((c) => c.health !== "delivering");
  const isPlayed = status!.mode !== "run";
  if (isPlayed || !bad.length) return { title: "Cameras", isDone: true, says: isPlayed ? "From a recording." : `${join(status!.cameras.map((c) => c.name))} deliver.` };
  return {
    title: "Cameras",
    isDone: false,
    says: bad.map((c) => `${c.name} is ${c.health}${c.message ? `: ${c.message}` : ""}.`).join(" ") + " For the cause and the remedy, run:",
    how: `huetrackd doctor ${status!.config_file}`,
  };
}

function exposure(lights: [string, Light | null][]): Step {
  const title = "Exposure";
  if (store.status!.mode !== "run") return { title, isDone: true, says: "As it was recorded." };
  const awaited = lights.filter(([, light]) => !light).map(([name]) => name);
  if (awaited.length) return { title, isDone: false, says: `Waiting for the picture of ${join(awaited)}.` };
  const dark = lights.filter(([, l]) => l!.dark > mostDark);
  const bright = lights.filter(([, l]) => l!.bright > mostBright);
  if (!dark.length && !bright.length) return { title, isDone: true, says: "Neither too dark nor too bright. Keep it so with each camera's controls; a network camera has its own settings." };
  const says = [
    ...dark.map(([name, l]) => `${name} is too dark: ${percent(l!.dark)} of its picture shows no colour.`),
    ...bright.map(([name, l]) => `${name} is too bright: ${percent(l!.bright)} of its picture is white.`),
  ];
  const name = (dark[0] ?? bright[0])[0];
  if (mayChange())
    return { title, isDone: false, says: `${says.join(" ")} Set its exposure, gain and white balance, and save them.`, button: [`Set up ${name}…`, () => openControls(name)] };
  return {
    title,
    isDone: false,
    says: `${says.join(" ")} Set its controls in ${store.status!.config_file}, and start again; huetrackd doctor lists them:`,
    how: `cameras:\n  ${name}:\n    controls: {exposure_time_absolute: ${dark.length ? "300, gain: 60" : "50, gain: 0"}, white_balance_temperature: 4600, power_line_frequency: 50 Hz}`,
  };
}

function calibration(): Step {
  const title = "Calibration";
  const missing = store.scene!.cameras.filter((c) => !c.model).map((c) => c.name);
  if (!missing.length) return { title, isDone: true, says: `The rig has ${store.scene!.cameras.length} cameras.` };
  const nothing = `The lenses and poses of ${join(missing)} are unknown.`;
  const why = calibrationRefused();
  if (store.status!.mode === "run" && !why)
    return { title, isDone: false, says: `${nothing} Carry a printed board in front of them: the page shows what is still missing in each picture.`, button: ["Calibrate…", openCalibration] };
  return {
    title,
    isDone: false,
    says: `${nothing} ${why ? `This page cannot do it: ${why} Or stop` : "Stop"} huetrackd, carry a board in front of the cameras while the command below runs (its page shows what is still missing), then write rig: rig.yaml into ${store.status!.config_file} and start again.`,
    how: `huetrack-calibrate extrinsics --board board.yaml ${missing.map((name) => `${name}=/dev/video…`).join(" ")} --rig rig.yaml --view view.html`,
  };
}

function color(): Step {
  const title = "Colour";
  const scene = store.scene!;
  const missing = scene.targets.filter((t) => !t.colors.length).map((t) => t.name);
  if (!scene.targets.length) return { title, isDone: false, says: "No target yet. What is its name, and what is its radius?", button: ["Add a target…", openTargets] };
  if (!missing.length) return { title, isDone: true, says: `${join(scene.targets.map((t) => t.name))}: known.` };
  if (!scene.may_teach) return { title, isDone: false, says: `${join(missing)}: no colour is configured. ${scene.why_not}` };
  return { title, isDone: false, says: `What colour is ${missing[0]}? Click on it in one picture, and confirm it in the others.`, button: [`Teach ${missing[0]}…`, () => openTeaching(missing[0])] };
}

function track(): Step {
  const title = "Track";
  const found = [...store.targets.values()].filter((t) => t.latest.state === "tracking");
  const sure = found.filter((t) => (t.history.at(-1)?.sigma ?? NaN) < goodSigma);
  if (sure.length) return { title, isDone: true, says: sure.map((t) => `${t.name} is tracked, ± ${(1000 * t.history.at(-1)!.sigma).toFixed(1)} mm.`).join(" ") };
  const why = store.status!.warnings.find((w) => /^target /.test(w));
  return { title, isDone: false, says: found.length ? "It is tracked, but not certain yet: let two cameras see it." : `Hold the object where two cameras see it. ${why ? `Now: ${why}.` : ""}` };
}

let isAsked = false; // the user wants to see them
let isHidden = false; // or not
let hasTracked = false;

function stepsNow(): Step[] {
  const later = (title: string): Step => ({ title, isDone: false, says: "" });
  if (!isServing() || !store.status) return [service(), ...["Exposure", "Calibration", "Colour", "Track"].map(later)];
  const lights = store.status.cameras.map((c): [string, Light | null] => [c.name, lightOf(c.name)]);
  if (!store.scene) return [cameras(), exposure(lights), ...["Calibration", "Colour", "Track"].map(later)];
  return [cameras(), exposure(lights), calibration(), color(), track()];
}

// Once a second.
export function updateSteps(): void {
  hasTracked ||= [...store.targets.values(), ...store.trackedCameras.values()].some((t) => t.latest?.state === "tracking");
  const isShown = store.connected && (isAsked || (!isHidden && !hasTracked));
  const panel = $("steps");
  if (panel.hidden === isShown) panel.hidden = !isShown;
  $("steps-open").setAttribute("aria-expanded", String(isShown));
  $("steps-open").hidden = isShown;
  if (!isShown) return;
  decodeAwaited(); // on a phone the pictures may be out of view
  const steps = stepsNow();
  const current = steps.findIndex((s) => !s.isDone);
  const list = $("steps-list");
  const key = JSON.stringify([steps, current]);
  if (list.dataset.shown !== key) {
    list.dataset.shown = key;
    list.replaceChildren(...steps.map((step, i) => itemOf(step, i === current)));
  }
  if (store.status?.mode === "run" && (current === 1 || isAsked)) drawLights(list.children[1] as HTMLElement);
}

function itemOf(step: Step, isCurrent: boolean): HTMLElement {
  const item = document.createElement("li");
  item.dataset.step = step.isDone ? "done" : isCurrent ? "current" : "later";
  if (isCurrent) item.setAttribute("aria-current", "step");
  const add = (tag: string, text: string) => item.appendChild(Object.assign(document.createElement(tag), { textContent: text }));
  add("h3", step.title);
  if (step.isDone || isCurrent) add("p", step.says);
  if (isCurrent && step.how) add("pre", step.how).tabIndex = 0;
  if (isCurrent && step.button) {
    const button = add("button", step.button[0]) as HTMLButtonElement;
    button.type = "button";
    button.className = "primary";
    button.addEventListener("click", step.button[1]);
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

$("steps-open").addEventListener("click", () => {
  isAsked = true;
  updateSteps();
  $("steps").scrollIntoView({ block: "nearest" });
});
$("steps-close").addEventListener("click", () => {
  isAsked = false;
  isHidden = true;
  updateSteps();
  $("steps-open").focus();
});
