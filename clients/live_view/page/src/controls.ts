// The cameras' controls with the picture and its brightness. A change applies at once; Save writes it beside the configuration.
import { drawLive, follow, lightOf } from "./cameras";
import { ask } from "./control";
import { updateHistory, whenStepped } from "./history";
import { drawLight } from "./light";
import { mayChange, store } from "./store";

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

const panel = $("controls-panel");
const camera = () => $<HTMLSelectElement>("controls-camera").value;
let changed = new Map<string, number>(); // since it was opened or saved, of this camera
let wanted: { name: string; value: number } | null = null; // the latest change that is not sent yet
let isSending = false;

function say(text: string, isBad = false): void {
  $("controls-says").textContent = text;
  $("controls-says").classList.toggle("bad", isBad);
}

async function read(): Promise<void> {
  const asking = camera();
  const reply = await ask("camera", "controls", asking);
  if (asking !== camera()) return;
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
  const text = () => (control.ruled ? `${control.value}, ${control.ruled}` : control.kind === "number" ? String(control.value) : "");
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
    if (!wanted && (!reply.granted || /auto|exposure|white_balance|focus/.test(name))) await read();
  }
  isSending = false;
  update();
}

async function save(): Promise<void> {
  const reply = await ask("camera", "save", camera(), ...[...changed].map(([name, value]) => `${name}=${value}`));
  say(reply.reason, !reply.granted);
  if (reply.granted) changed = new Map();
  void updateHistory();
  await read();
}

function update(): void {
  $<HTMLButtonElement>("controls-save").disabled = !changed.size || isSending;
}

// With the page's cards: the picture as it is now, and its light.
export function drawControls(): void {
  if (panel.hidden) return;
  drawLive($<HTMLCanvasElement>("controls-picture"), camera());
  const light = lightOf(camera());
  if (!light) return;
  drawLight($<HTMLCanvasElement>("controls-light"), camera(), light);
  const percent = (share: number) => `${(100 * share).toFixed(0)} %`;
  $("controls-lit").textContent = `${percent(light.dark)} too dark to show a colour, ${percent(light.bright)} white.`;
}

function fill(): void {
  changed = new Map();
  follow([camera()]);
  say("");
  void read();
}

function close(): void {
  panel.hidden = true;
  follow([]);
  $("controls-open").setAttribute("aria-expanded", "false");
}

// Once a second.
export function updateControls(serving: boolean): void {
  const { scene, status } = store;
  const allowed = serving && mayChange() && status?.mode === "run";
  $<HTMLButtonElement>("controls-open").disabled = !allowed && panel.hidden;
  $("controls-why").textContent = !serving || !scene ? "" : !mayChange() ? scene.why_not : status?.mode !== "run" ? "A recording's cameras have no controls." : "";
  const select = $<HTMLSelectElement>("controls-camera");
  const names = scene?.cameras.map((c) => c.name) ?? [];
  if ([...select.options].map((o) => o.value).join("\n") !== names.join("\n")) {
    select.replaceChildren(...names.map((name) => new Option(name, name)));
    if (!panel.hidden) fill();
  }
  drawControls();
}

function open(): void {
  panel.hidden = false;
  $("controls-open").setAttribute("aria-expanded", "true");
  fill();
  void updateHistory();
}

// From the first steps: the camera with a too dark or too bright picture.
export function openControls(name: string): void {
  $<HTMLSelectElement>("controls-camera").value = name;
  open();
  panel.scrollIntoView({ behavior: "smooth", block: "start" });
}

$("controls-open").addEventListener("click", () => (panel.hidden ? open() : close()));
$("controls-close").addEventListener("click", () => {
  close();
  $("controls-open").focus();
});
whenStepped("controls", (reply) => {
  changed = new Map();
  say(reply.reason, !reply.granted);
  setTimeout(() => void read(), 300); // the service has them set again
});
$("controls-camera").addEventListener("change", fill);
$("controls-save").addEventListener("click", () => void save());
