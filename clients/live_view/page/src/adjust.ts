// Targets by hand: colour by sliders with live matches, radius, name; new targets.
import { drawLive, follow, liveFigures, matchingShare, showLiveMasks, showRadius } from "./cameras";
import { ask } from "./control";
import { updateHistory, whenStepped } from "./history";
import type { Color, ControlReply } from "./messages";
import { setOptions } from "./options";
import { isServing, mayChange, store } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const field = (id: string) => $<HTMLInputElement>(`adjust-${id}`);
const choice = (id: string) => $<HTMLSelectElement>(`adjust-${id}`);

// The defaults of a configuration (service/color/color_model.h).
const untaught: Omit<Color, "camera"> = { hue_deg: [0, 300], saturation: [0.3, 1], intensity: [0.1, 0.95] };
const kinds = ["hue_deg", "saturation", "intensity"] as const;
type Kind = (typeof kinds)[number];
const scales: Record<Kind, number> = { hue_deg: 1, saturation: 100, intensity: 100 }; // of a slider's steps
const units: Record<Kind, string> = { hue_deg: "°", saturation: " %", intensity: " %" };

const panel = $("adjust-panel");
let shown = ""; // configuration shown by the sliders; a new one replaces it unless the user has moved one
let isTouched = false;
let isSized = false; // the user has typed a radius
let isBusy = false;

const sliders = (kind: Kind) => [0, 1].map((end) => field(`${kind}-${end}`)) as [HTMLInputElement, HTMLInputElement];
const target = () => store.scene?.targets.find((t) => t.name === choice("target").value);
const colorIn = (camera: string) => target()?.colors.find((c) => c.camera === camera);

function say(text: string, isBad = false): void {
  $("adjust-says").textContent = text;
  $("adjust-says").classList.toggle("bad", isBad);
}

const valuesOf = (kind: Kind) => sliders(kind).map((s) => Number(s.value) / scales[kind]) as [number, number];

function fill(): void {
  const now = target();
  const color = now?.colors.find((c) => !choice("camera").value || c.camera === choice("camera").value) ?? untaught;
  for (const kind of kinds) sliders(kind).forEach((slider, end) => (slider.value = String(Math.round(color[kind][end] * scales[kind]))));
  field("radius").value = now ? String(+(1000 * now.radius).toFixed(1)) : "";
  isTouched = isSized = false;
  show();
}

// What the hues mean: a swatch and names, as huetrackd says them (service/color/color_name.cpp).
const names = ["red", "orange", "yellow", "lime", "green", "mint", "cyan", "azure", "blue", "violet", "magenta", "rose"];
function showSwatch([low, high]: [number, number]): void {
  const width = high - low + (low > high ? 360 : 0);
  const [first, last] = [low, high].map((hue) => names[Math.round(hue / 30) % names.length]);
  const swatch = $("adjust-swatch");
  swatch.style.background = `linear-gradient(to right, ${[0, 1, 2, 3, 4].map((i) => `hsl(${low + (width * i) / 4} 80% 50%)`)})`;
  swatch.title = first === last ? first! : `${first} to ${last}`;
  swatch.setAttribute("aria-label", swatch.title);
}

// The sliders' values beside them, and in the pictures.
function show(): void {
  for (const kind of kinds) {
    const [low, high] = valuesOf(kind).map((v) => Math.round(v * scales[kind]));
    $(`adjust-${kind}-says`).textContent = `${low} to ${high}${units[kind]}${kind === "hue_deg" && low > high ? ", through 0" : ""}`;
  }
  showSwatch(valuesOf("hue_deg"));
  if (panel.hidden) return;
  const edited = Object.fromEntries(kinds.map((kind) => [kind, valuesOf(kind)])) as unknown as Omit<Color, "camera">;
  const cameras = (store.scene?.cameras ?? []).map((c) => c.name);
  const alone = choice("camera").value;
  showLiveMasks(
    new Map(
      cameras.map((camera) => {
        const color = !alone || alone === camera ? { camera, ...edited } : colorIn(camera) ?? { camera, ...untaught };
        return [camera, { color, ignored: (store.scene?.ignored ?? []).filter((i) => i.camera === camera).map((i) => i.box as number[]) }];
      }),
    ),
  );
  const now = target();
  showRadius(now ? now.name : "", now ? Number(field("radius").value) / (1000 * now.radius) : 1);
  drawAdjust();
}

// Each camera's picture with its matches and their share.
export function drawAdjust(): void {
  if (panel.hidden) return;
  for (const figure of $("adjust-pictures").querySelectorAll<HTMLElement>("figure")) {
    const camera = figure.dataset.camera!;
    drawLive(figure.querySelector("canvas")!, camera);
    const share = matchingShare(camera);
    figure.querySelector("span")!.textContent = share === null ? "" : `${(100 * share).toFixed(2)} %`;
  }
}

function makePictures(cameras: string[]): void {
  follow(cameras);
  const grid = $("adjust-pictures");
  if (!liveFigures(grid, cameras)) return;
  for (const figure of grid.children as unknown as HTMLElement[])
    figure.querySelector("canvas")!.setAttribute("aria-label", `What matches in ${figure.dataset.camera}`);
}

async function act(...words: string[]): Promise<ControlReply> {
  isBusy = true;
  update();
  const reply = await ask(...words);
  isBusy = false;
  say(reply.reason, !reply.granted);
  if (reply.granted) isTouched = isSized = false; // now the current values
  void updateHistory();
  update();
  return reply;
}

function save(): void {
  const pairs = kinds.map((kind) => `${kind}=${valuesOf(kind).map((v) => +v.toFixed(3)).join(",")}`);
  const camera = choice("camera").value ? [`camera=${choice("camera").value}`] : [];
  // A radius that was not typed is not sent: it is measured.
  const radius = isSized ? [`radius_m=${Number(field("radius").value) / 1000}`] : [];
  void act("target", "set", choice("target").value, ...pairs, ...radius, ...camera);
}

function update(): void {
  const isRadius = Number(field("radius").value) > 0;
  const name = field("name").value.trim();
  const isName = /^[A-Za-z](_?[A-Za-z0-9])*_?$/.test(name) && !store.scene?.targets.some((t) => t.name === name);
  $<HTMLButtonElement>("adjust-save").disabled = isBusy || !target() || !isRadius;
  $<HTMLButtonElement>("adjust-reset").disabled = isBusy || !isTouched;
  $<HTMLButtonElement>("adjust-add").disabled = isBusy || !isName;
  $<HTMLButtonElement>("adjust-rename").disabled = isBusy || !isName || !target();
  $<HTMLButtonElement>("adjust-remove").disabled = isBusy || !target() || (store.scene?.targets.length ?? 0) < 2;
  const chosen = choice("target").value;
  $("adjust-rename").textContent = `Rename ${chosen}`;
  $("adjust-remove").textContent = `Remove ${chosen}`;
}

function open(): void {
  panel.hidden = false;
  $("adjust-open").setAttribute("aria-expanded", "true");
  say("");
  fill();
  update();
  void updateHistory();
}

function close(): void {
  panel.hidden = true;
  $("adjust-open").setAttribute("aria-expanded", "false");
  showLiveMasks(null);
  showRadius("", 1);
  follow([]);
}

// From the first steps: there is no target yet.
export function openTargets(): void {
  updateAdjust(isServing());
  if (panel.hidden) open();
  updateAdjust(isServing());
  panel.scrollIntoView({ behavior: "smooth", block: "start" });
  field("name").focus({ preventScroll: true });
}

// Once a second.
export function updateAdjust(serving: boolean): void {
  const { scene } = store;
  const allowed = serving && mayChange();
  $<HTMLButtonElement>("adjust-open").disabled = !allowed && panel.hidden;
  $("adjust-why").textContent = !serving || !scene || mayChange() ? "" : scene.why_not;
  if (panel.hidden || !scene || !isServing()) return;
  makePictures(scene.cameras.map((c) => c.name));
  setOptions(choice("target"), scene.targets.map((t) => [t.name, t.name]));
  setOptions(choice("camera"), [["", "all cameras"], ...scene.cameras.map((c): [string, string] => [c.name, `${c.name} alone`])]);
  const now = JSON.stringify([scene.host, scene.pid, scene.targets]);
  if (now !== shown && !isTouched) {
    shown = now;
    fill();
  }
  update();
}

for (const kind of kinds)
  for (const slider of sliders(kind))
    slider.addEventListener("input", () => {
      isTouched = true;
      show();
      update();
    });
field("radius").addEventListener("input", () => {
  isTouched = isSized = true;
  show();
  update();
});
field("name").addEventListener("input", update);
for (const id of ["target", "camera"]) choice(id).addEventListener("change", () => (fill(), update()));
$("adjust-open").addEventListener("click", () => {
  if (!panel.hidden) return close();
  updateAdjust(true);
  open();
  updateAdjust(isServing());
});
$("adjust-close").addEventListener("click", () => {
  close();
  $("adjust-open").focus();
});
$("adjust-save").addEventListener("click", save);
$("adjust-reset").addEventListener("click", () => (fill(), update()));
// Uses the typed values for the new target, not those of another one.
$("adjust-add").addEventListener("click", () => {
  const mm = isSized ? Number(field("radius").value) : 0;
  void act("target", "add", field("name").value.trim(), ...(mm > 0 ? [`radius_m=${mm / 1000}`] : []));
});
$("adjust-rename").addEventListener("click", () => void act("target", "rename", choice("target").value, field("name").value.trim()));
$("adjust-remove").addEventListener("click", () => void act("target", "remove", choice("target").value));
whenStepped("adjust", (reply) => {
  say(reply.reason, !reply.granted);
  isTouched = false;
});
