// The cameras' controls with the picture and its brightness. A change applies at once; Save writes it beside the configuration.
import { choose, lightOf } from "./cameras";
import { ask, say as sayIn } from "./control";
import { enable } from "./hints";
import { updateHistory, whenStepped } from "./history";
import { drawLight } from "./light";
import { isOpen, onTool, refuse, show } from "./shell";
import { isServing, mayChange, serviceOf, store, withoutService } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

interface Control {
  name: string;
  value: number;
  min: number;
  max: number;
  step: number;
  kind: string;
  menu: [number, string][];
  ruled: string; // why it cannot be changed; empty: it can
}

// First, in this order: those that affect colours.
const first = [/^(auto_)?exposure(?!_.*metering)/, /gain/, /white_balance/, /power_line/, /brightness|contrast|saturation|hue|gamma/];
const rank = (name: string) => first.findIndex((kind) => kind.test(name)) + (first.some((kind) => kind.test(name)) ? 0 : first.length + 1);

const camera = () => $<HTMLSelectElement>("controls-camera").value;
let changed = new Map<string, number>(); // since it was opened or saved, of this camera
let wanted: { name: string; value: number } | null = null; // the latest change that is not sent yet
let isSending = false;

const say = (text: string, isBad = false) => sayIn($("controls-says"), text, isBad);

// ---- Cameras with controls that are reachable from here: none of a network or of another host.
let reachable: Set<string> | null = null; // null: not known yet
let askedOf = ""; // which service
let played = false; // the demo's: a recording in the place of live cameras
// Pictures are a recording's: nothing of them can be set.
export const isRecorded = () => store.status?.mode !== "run" || played;
export const hasControls = (name: string) => reachable === null || reachable.has(name);
async function learnReachable(): Promise<void> {
  const reply = await ask("camera", "list");
  reachable = reply.granted ? new Set(reply.rows.filter(([, how]) => how === "reached").map(([name]) => name)) : null;
  played = reply.granted && reply.rows.some(([, how]) => how === "played");
}

async function read(isQuiet = false): Promise<void> {
  const asking = camera();
  const reply = await ask("camera", "controls", asking);
  if (asking !== camera()) return;
  if (!isQuiet) say("");
  if (!reply.granted) {
    $("controls-list").replaceChildren();
    return say(reply.reason, true);
  }
  const all = reply.rows.map(([name, value, min, max, step, , kind, menu, ruled]): Control => ({
    name,
    value: Number(value),
    min: Number(min),
    max: Number(max),
    step: Number(step),
    kind,
    menu: menu ? menu.split(";").map((item) => [parseInt(item, 10), item.slice(item.indexOf("=") + 1)]) : [],
    ruled,
  }));
  all.sort((a, b) => rank(a.name) - rank(b.name));
  $("controls-list").replaceChildren(...all.map(row));
  update();
}

function row(control: Control): HTMLElement {
  const label = document.createElement("label");
  label.dataset.control = control.name;
  const title = document.createElement("b");
  title.textContent = control.name.replaceAll("_", " ");
  const says = document.createElement("span");
  const text = () => (control.ruled ? `${control.value}, ${control.ruled === "ruled by another" ? "set by its automatic" : control.ruled}` : control.kind === "number" ? String(control.value) : "");
  says.textContent = text();
  const move = (value: number) => {
    control.value = value;
    says.textContent = text();
    changed.set(control.name, value);
    void set({ name: control.name, value });
  };
  let input: HTMLInputElement | HTMLSelectElement;
  if (control.kind === "menu") {
    input = document.createElement("select");
    input.append(...control.menu.map(([value, name]) => new Option(name, String(value))));
    input.value = String(control.value);
    input.addEventListener("change", () => move(Number(input.value)));
  } else if (control.kind === "boolean") {
    const box = (input = Object.assign(document.createElement("input"), { type: "checkbox", checked: control.value !== 0 }));
    box.addEventListener("change", () => move(box.checked ? 1 : 0));
  } else {
    input = Object.assign(document.createElement("input"), { type: "range", min: String(control.min), max: String(control.max), step: String(control.step) });
    input.value = String(control.value);
    input.addEventListener("input", () => move(Number(input.value)));
  }
  input.disabled = control.ruled === "read only";
  label.append(title, input, says);
  return label;
}

// While a request is pending, only the latest further change is kept.
async function set(what: { name: string; value: number }): Promise<void> {
  wanted = what;
  update();
  if (isSending) return;
  isSending = true;
  while (wanted) {
    const { name, value } = wanted;
    wanted = null;
    const reply = await ask("camera", "set", camera(), `${name}=${value}`);
    say(reply.granted ? "Set, and not saved yet." : reply.reason, !reply.granted);
    if (!reply.granted) changed.delete(name);
    // An automatic control changes those that it rules.
    if (!wanted && (!reply.granted || /auto|exposure|white_balance|focus/.test(name))) await read(true);
  }
  isSending = false;
  update();
}

async function save(): Promise<void> {
  sayIn($("controls-says"), "Saving…", false, true);
  const reply = await ask("camera", "save", camera(), ...[...changed].map(([name, value]) => `${name}=${value}`));
  say(reply.reason, !reply.granted);
  if (reply.granted) changed = new Map();
  void updateHistory();
  await read(true);
}

function update(): void {
  enable($("controls-save"), isSending ? "wait for the camera" : changed.size ? "" : "nothing is changed");
}

// The light of the chosen camera's picture, which is marked among the large ones.
export function drawControls(): void {
  if (!isOpen("controls")) return;
  const light = lightOf(camera());
  if (!light) return;
  drawLight($<HTMLCanvasElement>("controls-light"), camera(), light);
  const percent = (share: number) => `${(100 * share).toFixed(0)} %`;
  $("controls-lit").textContent = `${percent(light.dark)} too dark to show a colour, ${percent(light.bright)} white.`;
}

function fill(): void {
  changed = new Map();
  choose(camera());
  $("controls-list").replaceChildren();
  sayIn($("controls-says"), "Reading the camera's controls…", false, true);
  void read();
}

function whyNot(serving: boolean): string {
  const { scene } = store;
  if (!serving || !scene) return withoutService();
  if (!mayChange()) return scene.why_not;
  if (isRecorded()) return "The pictures are a recording's: its cameras have no controls here.";
  return reachable && !reachable.size ? "These cameras are on the network or on other hosts: they are set in their own programs." : "";
}

// Once a second.
export function updateControls(serving: boolean): void {
  const { scene, status } = store;
  const service = serving && scene && mayChange() && status?.mode === "run" ? serviceOf(scene) : "";
  if (service !== askedOf) {
    askedOf = service;
    reachable = null;
    played = false;
    if (service) void learnReachable();
  }
  const was = panelIsRefused();
  refuse("controls", whyNot(serving));
  const select = $<HTMLSelectElement>("controls-camera");
  const names = (scene?.cameras.map((c) => c.name) ?? []).filter(hasControls);
  if ([...select.options].map((o) => o.value).join("\n") !== names.join("\n")) {
    const chosen = select.value;
    select.replaceChildren(...names.map((name) => new Option(name, name)));
    if (names.includes(chosen)) select.value = chosen;
    if (isOpen("controls") && select.value !== chosen && !panelIsRefused()) fill();
  } else if (was && isOpen("controls") && !panelIsRefused()) fill();
  drawControls();
}
const panelIsRefused = () => $("controls-panel").hasAttribute("data-refused");

// From the first steps and the warnings: the camera with a too dark or too bright picture.
export function openControls(name: string): void {
  $<HTMLSelectElement>("controls-camera").value = name;
  if (isOpen("controls")) fill();
  else show("controls");
}

onTool("controls", {
  opened: () => {
    updateControls(isServing());
    if (!panelIsRefused()) fill();
    void updateHistory();
  },
  closed: () => choose(""),
});
whenStepped("controls", (reply) => {
  changed = new Map();
  say(reply.reason, !reply.granted);
  setTimeout(() => void read(true).then(() => say(reply.reason, !reply.granted)), 300); // the service has them set again
});
$("controls-camera").addEventListener("change", fill);
$("controls-save").addEventListener("click", () => void save());
