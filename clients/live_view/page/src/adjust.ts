// Targets by hand: colour by sliders with live matches, radius, name; new targets.
import { clearLayers, colorAt, matchingShare, setLayer, showLiveMasks, showRadius } from "./cameras";
import { askAloud, say as sayIn } from "./control";
import { enable } from "./hints";
import { updateHistory, whenStepped } from "./history";
import type { Color, ControlReply } from "./messages";
import { setOptions } from "./options";
import { isOpen, onTool, refuse, show as showTool } from "./shell";
import { isServing, mayChange, store, withoutService } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const field = (id: string) => $<HTMLInputElement>(`adjust-${id}`);
const choice = (id: string) => $<HTMLSelectElement>(`adjust-${id}`);

// Without a colour nothing matches. Saturation and intensity are a configuration's defaults (service/color/color_model.h).
const untaught: Omit<Color, "camera"> = { hue_deg: [0, 0], saturation: [0.3, 1], intensity: [0.1, 0.95] };
const pickedHue = 20, pickedShare = 0.25; // around a colour that was clicked on: degrees; of saturation and intensity
const kinds = ["hue_deg", "saturation", "intensity"] as const;
type Kind = (typeof kinds)[number];
const scales: Record<Kind, number> = { hue_deg: 1, saturation: 100, intensity: 100 }; // of a slider's steps
const units: Record<Kind, string> = { hue_deg: "°", saturation: " %", intensity: " %" };

let shown = ""; // configuration shown by the sliders; a new one replaces it unless the user has moved one
let isTouched = false; // a slider was moved
let isBlank = true; // it has no colour, and none was chosen
let isSized = false; // the user has typed a radius
let isBusy = false;

const sliders = (kind: Kind) => [0, 1].map((end) => field(`${kind}-${end}`)) as [HTMLInputElement, HTMLInputElement];
const target = () => store.scene?.targets.find((t) => t.name === choice("target").value);
const colorIn = (camera: string) => target()?.colors.find((c) => c.camera === camera);

const say = (text: string, isBad = false) => sayIn($("adjust-says"), text, isBad);

const valuesOf = (kind: Kind) => sliders(kind).map((s) => Number(s.value) / scales[kind]) as [number, number];

function fill(): void {
  const now = target();
  const known = now?.colors.find((c) => !choice("camera").value || c.camera === choice("camera").value);
  const color = known ?? untaught;
  isBlank = !known;
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
  swatch.hidden = isBlank;
  swatch.style.background = `linear-gradient(to right, ${[0, 1, 2, 3, 4].map((i) => `hsl(${low + (width * i) / 4} 80% 50%)`)})`;
  swatch.title = first === last ? first! : `${first} to ${last}`;
  swatch.setAttribute("aria-label", swatch.title);
}

// The sliders' values beside them, and in the pictures.
function show(): void {
  for (const kind of kinds) {
    const [low, high] = valuesOf(kind).map((v) => Math.round(v * scales[kind]));
    $(`adjust-${kind}-says`).textContent = isBlank && kind === "hue_deg" ? "none yet" : `${low} to ${high}${units[kind]}${kind === "hue_deg" && low > high ? ", through 0" : ""}`;
  }
  showSwatch(valuesOf("hue_deg"));
  if (!isOpen("adjust")) return;
  const edited = Object.fromEntries(kinds.map((kind) => [kind, valuesOf(kind)])) as unknown as Omit<Color, "camera">;
  const cameras = (store.scene?.cameras ?? []).map((c) => c.name);
  const alone = choice("camera").value;
  showLiveMasks(
    isBlank ? null : new Map(
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

// The matching share of each picture.
export function drawAdjust(): void {
  if (!isOpen("adjust")) return;
  for (const item of $("adjust-cameras").children as unknown as HTMLElement[]) {
    const share = matchingShare(item.dataset.camera!);
    item.querySelector(".chip")!.textContent = share === null ? "" : `${(100 * share).toFixed(2)} % matches`;
  }
}

function listCameras(cameras: string[]): void {
  const list = $("adjust-cameras");
  if ([...list.children].map((item) => (item as HTMLElement).dataset.camera).join("\n") === cameras.join("\n")) return;
  list.replaceChildren(
    ...cameras.map((camera) => {
      const item = document.createElement("li");
      item.dataset.camera = camera;
      item.innerHTML = `<b></b><span class="chip"></span>`;
      item.querySelector("b")!.textContent = camera;
      return item;
    }),
  );
  for (const camera of cameras) setLayer(camera, { point: (pixel) => pick(camera, pixel) });
}

// A click on the object: ranges around its colour, to begin with.
function pick(camera: string, pixel: [number, number]): void {
  const rgb = colorAt(camera, pixel);
  if (!rgb) return;
  const [r, g, b] = rgb;
  const intensity = (r + g + b) / 3;
  const saturation = intensity > 0 ? 1 - Math.min(r, g, b) / intensity : 0;
  const hue = ((Math.atan2((Math.sqrt(3) / 2) * (g - b), r - (g + b) / 2) * 180) / Math.PI + 360) % 360;
  const around = (value: number) => [Math.max(0, value - pickedShare), Math.min(1, value + pickedShare)];
  const ranges = { hue_deg: [(hue - pickedHue + 360) % 360, (hue + pickedHue) % 360], saturation: around(saturation), intensity: around(intensity / 255) };
  for (const kind of kinds) sliders(kind).forEach((slider, end) => (slider.value = String(Math.round(ranges[kind][end] * scales[kind]))));
  touched();
}

function touched(): void {
  isTouched = true;
  isBlank = false;
  show();
  update();
}

async function act(...words: string[]): Promise<ControlReply> {
  isBusy = true;
  update();
  const reply = await askAloud($("adjust-says"), ...words);
  isBusy = false;
  if (reply.granted) isTouched = isSized = false; // now the current values
  void updateHistory();
  update();
  return reply;
}

function save(): void {
  const pairs = isBlank ? [] : kinds.map((kind) => `${kind}=${valuesOf(kind).map((v) => +v.toFixed(3)).join(",")}`);
  const camera = choice("camera").value ? [`camera=${choice("camera").value}`] : [];
  // A radius that was not typed is not sent: it is measured.
  const radius = isSized ? [`radius_m=${Number(field("radius").value) / 1000}`] : [];
  void act("target", "set", choice("target").value, ...pairs, ...radius, ...camera);
}

function update(): void {
  const isRadius = Number(field("radius").value) > 0;
  const name = field("name").value.trim();
  const isName = /^[A-Za-z](_?[A-Za-z0-9])*_?$/.test(name) && !store.scene?.targets.some((t) => t.name === name);
  const wait = isBusy ? "wait for the service" : "";
  const noTarget = target() ? "" : "there is no target yet";
  const noName = isName ? "" : !name ? "type a name" : store.scene?.targets.some((t) => t.name === name) ? "this name is taken" : "letters, digits and single _, beginning with a letter";
  const chosen = choice("target").value;
  $("adjust-rename").textContent = `Rename ${chosen}`;
  $("adjust-remove").textContent = `Remove ${chosen}`;
  enable($("adjust-save"), wait || noTarget || (isBlank && !isSized ? "choose a colour first" : isRadius ? "" : "type its radius, or teach its colour, which measures it"));
  $("adjust-reset").hidden = !isTouched;
  enable($("adjust-reset"), wait);
  enable($("adjust-add"), wait || noName);
  enable($("adjust-rename"), wait || noName || noTarget);
  enable($("adjust-remove"), wait || noTarget || ((store.scene?.targets.length ?? 0) < 2 ? "it is the only target" : ""));
}

function opened(): void {
  say("");
  updateAdjust(isServing());
  fill();
  update();
  void updateHistory();
}

function closed(): void {
  showLiveMasks(null);
  showRadius("", 1);
  clearLayers();
  $("adjust-cameras").replaceChildren();
}

// From the first steps: there is no target yet.
export function openTargets(): void {
  showTool("adjust");
  $<HTMLDetailsElement>("adjust-names").open = true;
  field("name").focus({ preventScroll: true });
}

// Once a second.
export function updateAdjust(serving: boolean): void {
  const { scene } = store;
  refuse("adjust", !serving || !scene ? withoutService() : mayChange() ? "" : scene.why_not);
  if (!isOpen("adjust") || !scene || !serving || !mayChange()) return;
  listCameras(scene.cameras.map((c) => c.name));
  $<HTMLDetailsElement>("adjust-names").open ||= !scene.targets.length;
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
    slider.addEventListener("input", touched);
field("radius").addEventListener("input", () => {
  isTouched = isSized = true;
  show();
  update();
});
field("name").addEventListener("input", update);
for (const id of ["target", "camera"]) choice(id).addEventListener("change", () => (fill(), update()));
onTool("adjust", { opened, closed });
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
