// Recordings of the service: start, stop, save the pre-roll, list, download.
import { ask, askAloud, say } from "./control";
import { enable } from "./hints";
import { isOpen, onTool, refuse } from "./shell";
import { isServing, serviceOf, store, withoutService } from "./store";
import { write } from "./text";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const askEvery = 2000; // ms, while the panel is in view
const askRarely = 10000; // ms, if the service does not answer or allow it
let asked = -Infinity;
let isAsking = false;
let service = ""; // of the shown replies
let why = ""; // why nothing can be recorded
let state: Record<string, string> | null = null; // null: unknown or not allowed

const says = $("recordings-says");
const serviceNow = () => (isServing() && store.scene ? serviceOf(store.scene) : "");

// Once a second, and after every action.
export function updateRecordings(): void {
  const now = serviceNow();
  if (now !== service) {
    service = now;
    state = null;
    asked = -Infinity;
    why = "";
    say(says, "");
    show([], false);
  }
  refuse("recordings", now ? why : withoutService());
  // Closed, only whether it records is shown.
  const isDue = performance.now() - asked >= (state && isOpen("recordings") ? askEvery : askRarely);
  if (now && isDue && !isAsking && !document.hidden) void refresh();
  updateButtons();
}

async function refresh(): Promise<void> {
  isAsking = true;
  const asking = service;
  try {
    const reply = await ask("record", "state");
    const listed = reply.granted && isOpen("recordings") ? await ask("record", "list") : null;
    if (asking !== service) return;
    state = reply.granted ? Object.fromEntries(reply.rows.map(([key, value]) => [key, value])) : null;
    why = reply.granted ? "" : reply.reason;
    refuse("recordings", why);
    if (listed) show(listed.granted ? listed.rows : [], listed.granted);
  } finally {
    isAsking = false;
    asked = performance.now();
    updateButtons();
  }
}

function updateButtons(): void {
  const isLive = state !== null && state.state !== "replay";
  const isRecording = state?.state === "recording";
  const preRoll = Number(state?.pre_roll_s ?? 0);
  const isAlways = state?.always === "true";
  // Shortly after the start, after a recording, and where its memory is small, there is less than was asked for.
  const held = Number(state?.pre_roll_held_s ?? preRoll);
  const isLess = held < preRoll - 1;
  write($("record-save"), !preRoll ? "Save the last seconds" : isLess ? `Save the last ${Math.floor(held)} s of ${preRoll}` : `Save the last ${preRoll} s`);
  const noState = state === null ? "wait for the service" : isLive ? "" : "a replay is not recorded";
  $("record-start").hidden = isRecording;
  $("record-stop").hidden = !isRecording;
  enable($("record-start"), noState);
  enable($("record-stop"), noState || (isAlways ? "the configuration records always" : ""));
  enable($("record-save"), noState || (isRecording ? "it records already" : preRoll ? "" : "the configuration keeps no last seconds (record: {pre_roll_s: 30})"));
  $("recordings-open").toggleAttribute("data-lamp", isRecording);
  const lamp = $("record-state");
  lamp.dataset.state = state?.state ?? "none";
  lamp.textContent = state === null ? "" : isRecording ? `recording ${state.name}` : state.state === "replay" ? "a replay is not recorded" : "not recording";
}

async function act(word: string): Promise<void> {
  const reply = await askAloud(says, "record", word);
  say(says, reply.reason.replace(/\/\S*\/(\d{8}T)/, "$1"), !reply.granted); // without its folder
  await refresh();
}

const duration = (seconds: number) =>
  seconds < 60 ? `${seconds.toFixed(1)} s` : `${Math.floor(seconds / 60)} min ${String(Math.floor(seconds % 60)).padStart(2, "0")} s`;
const size = (bytes: number) => (bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`);
const moment = (text: string) => (text ? new Date(1000 * Number(text)).toLocaleString(undefined, { dateStyle: "short", timeStyle: "short" }) : "");

let shown = "";
function show(rows: string[][], isListed: boolean): void {
  const key = JSON.stringify([rows, isListed, state?.state === "replay"]);
  if (key === shown) return;
  shown = key;
  $("recordings-table").hidden = !rows.length;
  $("recordings-none").hidden = rows.length > 0 || !isListed;
  $("recordings-list").replaceChildren(...rows.map(rowOf));
}

function rowOf([name, begun, length, bytes, cameras, how]: string[]): HTMLTableRowElement {
  const row = document.createElement("tr");
  row.dataset.recording = name;
  const picture = row.insertCell();
  const isDone = how !== "recording";
  if (isDone) picture.append(thumbnail(name));
  const title = row.insertCell();
  title.append(Object.assign(document.createElement("b"), { textContent: name }));
  const details = [moment(begun), cameras === "1" ? "1 camera" : `${cameras} cameras`].filter(Boolean).join(", ");
  title.append(Object.assign(document.createElement("small"), { textContent: details }));
  row.insertCell().textContent = duration(Number(length));
  row.insertCell().textContent = size(Number(bytes));
  const actions = title.appendChild(Object.assign(document.createElement("div"), { className: "actions" }));
  if (!isDone) {
    actions.textContent = "being recorded";
    return row;
  }
  const link = Object.assign(document.createElement("a"), { href: `/api/recordings/${encodeURIComponent(name)}.tar`, download: `${name}.tar`, textContent: "Download", className: "button quiet" });
  link.setAttribute("aria-label", `Download ${name}`);
  actions.append(link);
  if (state?.state === "replay") return row;
  const add = (text: string, label: string, what: () => Promise<void>) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: text, className: "quiet" });
    button.setAttribute("aria-label", label);
    button.addEventListener("click", () => void what());
    actions.append(button);
  };
  add("Replay", `Replay ${name} instead of the cameras`, async () => void (await askAloud(says, "replay", "open", name)));
  add("Delete…", `Delete ${name}`, async () => {
    if (!confirm(`Delete the recording ${name}, ${size(Number(bytes))}? This cannot be undone.`)) return;
    await askAloud(says, "record", "delete", name);
    await refresh();
  });
  return row;
}

// One after the other, and each once: the service decodes them.
const pictures = new Map<string, Promise<string>>(); // addresses, by name; empty: there is none
let lastPicture: Promise<unknown> = Promise.resolve();
function thumbnail(name: string): HTMLElement {
  const picture = Object.assign(document.createElement("img"), { alt: "", width: 64, height: 48 });
  const key = `${service}/${name}`;
  let address = pictures.get(key);
  if (!address) {
    address = lastPicture.then(async () => {
      const answer = await fetch(`/api/recordings/${encodeURIComponent(name)}.jpg`);
      return answer.ok ? URL.createObjectURL(await answer.blob()) : "";
    }).catch(() => "");
    lastPicture = address;
    pictures.set(key, address);
  }
  void address.then((source) => (source ? (picture.src = source) : picture.remove()));
  return picture;
}

onTool("recordings", { opened: () => ((asked = -Infinity), updateRecordings()) });
for (const word of ["start", "stop", "save"]) $(`record-${word}`).addEventListener("click", () => void act(word));
