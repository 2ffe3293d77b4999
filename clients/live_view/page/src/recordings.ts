// Recordings of the service: start, stop, save the pre-roll, list, download.
import { ask } from "./control";
import type { ControlReply } from "./messages";
import { isServing, serviceOf, store } from "./store";
import { isHidden, watchVisibility } from "./visibility";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const askEvery = 2000; // ms, while the panel is in view
const askRarely = 10000; // ms, if the service does not answer or allow it
let asked = -Infinity;
let isAsking = false;
let service = ""; // of the shown replies
let state: Record<string, string> | null = null; // null: unknown or not allowed

const panel = $("recordings");
const says = $("recordings-says");
const serviceNow = () => (isServing() && store.scene ? serviceOf(store.scene) : "");

function say(reply: ControlReply): void {
  says.textContent = reply.reason;
  says.classList.toggle("bad", !reply.granted);
}

// Once a second, and after every action.
export function updateRecordings(): void {
  const now = serviceNow();
  if (now !== service) {
    service = now;
    state = null;
    asked = -Infinity;
    says.textContent = "";
    $("recordings-why").textContent = "";
    show([]);
  }
  $("recordings-why").hidden = !$("recordings-why").textContent;
  const isDue = performance.now() - asked >= (state ? askEvery : askRarely);
  if (now && isDue && !isAsking && !document.hidden && !isHidden(panel)) void refresh();
  updateButtons();
}

async function refresh(): Promise<void> {
  isAsking = true;
  const asking = service;
  try {
    const reply = await ask("record", "state");
    const listed = reply.granted ? await ask("record", "list") : null;
    if (asking !== service) return;
    state = reply.granted ? Object.fromEntries(reply.rows.map(([key, value]) => [key, value])) : null;
    $("recordings-why").textContent = reply.granted ? "" : reply.reason;
    $("recordings-why").hidden = reply.granted;
    if (listed) show(listed.granted ? listed.rows : []);
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
  $<HTMLButtonElement>("record-start").disabled = !isLive || isRecording;
  $<HTMLButtonElement>("record-stop").disabled = !isLive || !isRecording || isAlways;
  $<HTMLButtonElement>("record-save").disabled = !isLive || isRecording || !preRoll;
  $("record-save").textContent = preRoll ? `Save the last ${preRoll} s` : "Save the last seconds";
  const lamp = $("record-state");
  lamp.dataset.state = state?.state ?? "none";
  lamp.textContent = state === null ? "" : isRecording ? `recording ${state.name}` : state.state === "replay" ? "a replay is not recorded" : "not recording";
}

async function act(word: string): Promise<void> {
  say(await ask("record", word));
  await refresh();
}

const duration = (seconds: number) =>
  seconds < 60 ? `${seconds.toFixed(1)} s` : `${Math.floor(seconds / 60)} min ${String(Math.floor(seconds % 60)).padStart(2, "0")} s`;
const size = (bytes: number) => (bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`);
const moment = (text: string) => (text ? new Date(1000 * Number(text)).toLocaleString() : "");

let shown = "";
function show(rows: string[][]): void {
  const key = JSON.stringify([rows, state?.state === "replay"]);
  if (key === shown) return;
  shown = key;
  $("recordings-table").hidden = !rows.length;
  $("recordings-list").replaceChildren(
    ...rows.map(([name, begun, length, bytes, cameras, how]) => {
      const row = document.createElement("tr");
      row.dataset.recording = name;
      const cell = (text: string) => (row.insertCell().textContent = text);
      cell(name);
      cell(moment(begun));
      cell(duration(Number(length)));
      cell(size(Number(bytes)));
      cell(cameras);
      // On a phone, which has no column headings.
      row.lastElementChild!.append(Object.assign(document.createElement("span"), { className: "unit", textContent: cameras === "1" ? " camera" : " cameras" }));
      const last = row.insertCell();
      if (how === "recording") last.textContent = "being recorded";
      else {
        const link = document.createElement("a");
        link.href = `/api/recordings/${encodeURIComponent(name)}.tar`;
        link.download = `${name}.tar`;
        link.textContent = "Download";
        link.setAttribute("aria-label", `Download ${name}`);
        last.append(link);
        const remove = Object.assign(document.createElement("button"), { type: "button", textContent: "Delete…" });
        remove.setAttribute("aria-label", `Delete ${name}`);
        remove.addEventListener("click", async () => {
          if (!confirm(`Delete the recording ${name}, ${size(Number(bytes))}? This cannot be undone.`)) return;
          say(await ask("record", "delete", name));
          await refresh();
        });
        if (state?.state !== "replay") {
          const replay = Object.assign(document.createElement("button"), { type: "button", textContent: "Replay" });
          replay.setAttribute("aria-label", `Replay ${name} instead of the cameras`);
          replay.title = "Instead of the cameras, until it is over, or closed";
          replay.addEventListener("click", async () => say(await ask("replay", "open", name)));
          last.append(" ", replay, " ", remove);
        }
      }
      return row;
    }),
  );
}

for (const word of ["start", "stop", "save"]) $(`record-${word}`).addEventListener("click", () => void act(word));
watchVisibility(panel, updateRecordings);
