// The service's warnings, a line a kind: which cameras or targets, what is wrong, and a button that does what it advises.
import { openTargets } from "./adjust";
import { calibrationRefused, openCalibration } from "./calibrate";
import { hasControls, openControls } from "./controls";
import { openTool, show } from "./shell";
import { isServing, mayChange, store } from "./store";
import { openTeaching } from "./teach";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
// On a phone an open tool needs the room.
const narrow = matchMedia("(max-width: 760px)");
const mostLines = () => (narrow.matches && openTool() ? 1 : 3);
type Level = "bad" | "warn" | "info";
const levels: Level[] = ["bad", "warn", "info"];

interface Kind {
  is: RegExp;
  level: Level;
  // Instead of the service's own words, which advise lines of a file or of a terminal; {} is its first group.
  says?: string;
  act?: (names: string[]) => Action | null;
}
type Action = [string, () => void];

// ---- Buttons, where the page can do what is advised.
const setUp = (names: string[]): Action | null => {
  const camera = names.find((name) => isCamera(name) && hasControls(name));
  return camera && mayChange() && store.status?.mode === "run" ? [`Set up ${camera}…`, () => openControls(camera)] : null;
};
const calibrate = (what: "board" | "wave" | "") => (): Action | null =>
  store.status?.mode === "run" && !calibrationRefused() ? [what === "wave" ? "Measure by waving…" : "Calibrate…", () => openCalibration(what)] : null;
const teach = (names: string[]): Action | null => {
  const target = (store.scene?.targets.find((t) => names.some((name) => name === t.name || name.startsWith(`${t.name} in `))) ?? store.scene?.targets[0])?.name;
  return target && store.scene?.may_teach ? [`Teach ${target}…`, () => openTeaching(target)] : null;
};
const adjust = (): Action | null => (mayChange() ? ["Targets…", () => (store.scene?.targets.length ? show("adjust") : openTargets())] : null);
const health = (): Action => ["Health…", () => show("health")];

const light = "light"; // kinds of this family contradict "the exposure is well"
const kinds: (Kind & { family?: string })[] = [
  { is: /delivers no pictures/, level: "bad", act: health },
  { is: /^the cameras are not calibrated/, level: "bad", says: "The cameras are not calibrated, so nothing is tracked", act: calibrate("") },
  { is: /time stamps are arrival times/, level: "info", says: "no time stamps of their own and an unknown latency: positions of fast objects are less certain", act: calibrate("wave") },
  { is: /automatic exposure is on|exposure is automatic/, level: "warn", family: light, says: "the exposure is automatic, or the light changes: colours drift", act: setUp },
  { is: /automatic white balance is on/, level: "warn", family: light, says: "the white balance is automatic, or the light changes: colours drift", act: setUp },
  { is: /the light flickers at (\d+) Hz/, level: "warn", family: light, says: "the light flickers at {} Hz: match the mains frequency or the exposure", act: setUp },
  { is: /^the time stamps of .+ are wrong/, level: "warn", act: calibrate("wave") },
  { is: /^target \S+ has no colour yet/, level: "warn", says: "no colour yet", act: teach },
  { is: /is not found: /, level: "warn", act: teach },
  { is: /the latency is not known yet/, level: "info", act: calibrate("wave") },
  { is: /colour (differs|is \S+ than the configured)/, level: "warn", act: teach },
  { is: /overlapping colours|tracked at the same place/, level: "warn", act: adjust },
  { is: /correct radius_m/, level: "warn", act: adjust },
  { is: /of the picture has the colour of (\S+) and never moves/, level: "info", says: "a part of the picture has the colour of {} and never moves: it is ignored as long as it looks the same; narrow the colour, or cover it", act: adjust },
  { is: /something else has its colour|more objects than|narrow the colour/, level: "info", act: adjust },
  { is: /repeated one picture|repeats its pictures|no frame/, level: "bad", act: health },
  { is: /calibrate (it |the lens |them )?again|was turned|sags|its zoom or focus|rig was found|rig looks like/, level: "warn", act: calibrate("board") },
  { is: /rig has not been checked/, level: "info", act: calibrate("board") },
  { is: /wall clock was changed|cannot be written|no space|disk is full/i, level: "bad" },
];

// Words of a command line or of a file, and what the page says instead. In order.
const elsewhere: [RegExp, string][] = [
  [/:? ?calibrate them on the page of huetrack view, or with huetrack-calibrate/, ""],
  [/;? check it with huetrack-calibrate check/, ""],
  [/,? or run huetrack-calibrate time beforehand/, ""],
  [/: measure it with huetrack-calibrate time, or set latency_offset_s/, ""],
  [/correct its time stamps or timing\.latency_s/, "correct its time stamps or its latency"],
  [/correct the time stamps or timing\.latency_s/, "correct the time stamps or the latency"],
  [/correct radius_m/, "correct the radius"],
  [/color: adapt/g, "adaptation"],
  [/, or set color: \{adapt: true\}/, ""],
  [/ \(a tag: ffmpeg[^)]*\)/, ""],
  [/: set controls: .*$/, ""],
  [/\. Set \w+ under cameras\.\S+/, ""],
];
const live: [RegExp, string][] = [
  [/: frames were dropped and not counted, or a network delays them.*$/, ": pictures are delayed or dropped on their way: measure their latency by waving, or use cameras that stamp their pictures"],
];
const inReplay: [RegExp, string][] = [
  [/ \(recording\.yaml: timestamps\), or use cameras whose driver stamps the frames/, ""],
  [/ until it is estimated from their motion: keep moving the object/, " until the object has moved for some seconds"],
];

const isCamera = (name: string) => !!store.status?.cameras.some((c) => c.name === name);

interface Line {
  level: Level;
  names: string[];
  text: string;
  action: Action | null;
}

// "camera cam1: its exposure ..." is of cam1.
function parted(warning: string): { names: string[]; rest: string } {
  const [, , name, rest] = /^((?:camera|target) )?([^\s:]+): (.*)$/s.exec(warning) ?? [];
  if (name && (isCamera(name) || store.status?.targets.includes(name))) return { names: [name], rest };
  const [, whole, colored, words] = /^((\S+) in \S+): (.*)$/s.exec(warning) ?? []; // a target's colour in a camera
  if (store.status?.targets.includes(colored)) return { names: [whole], rest: words };
  const [, several, are] = /^the time stamps of (.+) are (wrong.*)$/s.exec(warning) ?? [];
  if (several) return { names: several.split(/, | and /), rest: `time stamps are ${are}` };
  const target = /^target (\S+) (.*)$/s.exec(warning);
  if (target) return { names: [target[1].replace(/:$/, "")], rest: target[2] };
  const camera = /^(?:camera )?(\S+?)('s)? (.*)$/s.exec(warning);
  if (camera && isCamera(camera[1])) return { names: [camera[1]], rest: camera[2] ? `its ${camera[3]}` : camera[3] };
  return { names: [], rest: warning };
}

const withoutNumbers = (text: string) => text.replace(/[\d.]+/g, "#");

function linesOf(warnings: string[]): Line[] {
  const groups = new Map<string, { kind: Kind | undefined; names: string[]; text: string }>();
  for (const warning of warnings) {
    const kind = kinds.find((k) => k.is.test(warning));
    const { names, rest } = parted(warning);
    const first = kind?.is.exec(warning)?.[1] ?? "";
    const text = kind?.says?.replace("{}", first) ?? [...elsewhere, ...(store.status?.mode === "run" ? live : inReplay)].reduce((words, [from, to]) => words.replace(from, to), rest);
    const key = withoutNumbers(text);
    const known = groups.get(key);
    if (known) known.names.push(...names.filter((name) => !known.names.includes(name)));
    else groups.set(key, { kind, names: [...names], text });
  }
  return [...groups.values()]
    .map(({ kind, names, text }) => ({ level: kind?.level ?? "warn", names, text, action: kind?.act?.(names) ?? null }))
    .sort((a, b) => levels.indexOf(a.level) - levels.indexOf(b.level));
}

// What is wrong with the light, as the steps say it; null: nothing.
export function lightTrouble(): { cameras: string[]; text: string } | null {
  const all = (store.status?.warnings ?? []).filter((w) => kinds.find((k) => k.is.test(w))?.family === light);
  if (!all.length) return null;
  const [first] = linesOf(all);
  return { cameras: first.names, text: `${first.names.length ? `in ${first.names.join(", ")} ` : ""}${first.text}` };
}

// As `huetrack status` says it. A replay's cameras may have ended.
function silentCameras(): string[] {
  const { mode, cameras } = store.status!;
  const begins = store.rates.length < 3; // statuses: a camera may take as long to open
  return cameras
    .filter((c) => mode === "run" && c.health !== "delivering" && !(begins && c.health === "waiting"))
    .map((c) => `camera ${c.name}: delivers no pictures${c.message && !c.message.startsWith("no frame") ? `: ${c.message}` : ""}`);
}

const capital = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);
let isAll = false;
let actions: (Action | null)[] = [];

export function updateNotices(): void {
  const { status, pulse } = store;
  const lines = isServing() ? linesOf([...silentCameras(), ...status!.warnings]) : [];
  if (pulse?.trouble) lines.unshift({ level: "bad", names: [], text: pulse.trouble, action: null });
  const list = $("warnings");
  const shown = isAll ? lines : lines.slice(0, mostLines());
  actions = shown.map((line) => line.action);
  const key = JSON.stringify([shown, shown.map((line) => line.action?.[0]), lines.length]);
  $("notices").hidden = lines.length === 0;
  if (list.dataset.shown === key) return;
  list.dataset.shown = key;
  list.replaceChildren(...shown.map(itemOf));
  const more = $("warnings-more");
  const hidden = lines.length - mostLines();
  more.hidden = hidden <= 0 && !isAll;
  more.textContent = isAll ? "Fewer" : `${hidden} more`;
  more.setAttribute("aria-expanded", String(isAll));
  $("notices").dataset.all = String(isAll);
}

function itemOf(line: Line, index: number): HTMLElement {
  const item = document.createElement("li");
  item.dataset.level = line.level;
  const text = document.createElement("p");
  // "navy is not found", but "cam0, cam1: no time stamps".
  const colon = line.names.length === 1 && /^(is|has|was|sees|sags|delivers) /.test(line.text) ? " " : ": ";
  const words = line.names.length > 1 ? line.text.replace(/^delivers /, "") : line.text;
  if (line.names.length) text.append(Object.assign(document.createElement("b"), { textContent: line.names.join(", ") + colon }), words);
  else text.textContent = capital(line.text);
  text.title = text.textContent!;
  item.append(text);
  if (!line.action) return item;
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: line.action[0] });
  button.addEventListener("click", () => actions[index]?.[1]());
  item.append(button);
  return item;
}

$("warnings-more").addEventListener("click", () => {
  isAll = !isAll;
  updateNotices();
});
