// Controls of a replay: pause, step, speed.
import { ask } from "./control";
import { isServing, serviceOf, store } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

let service = ""; // of the shown state
let isAllowed = false;
let isKnown = false; // whether it is
let isPaused = false;
let asking = 0; // requests that are on their way

async function send(...words: string[]): Promise<void> {
  asking++;
  const reply = await ask("replay", ...words);
  asking--;
  isAllowed = reply.granted;
  isKnown = reply.granted || reply.number > 0; // the service itself refused
  if (reply.granted) {
    const state = Object.fromEntries(reply.rows.map(([key, value]) => [key, value]));
    isPaused = state.state === "paused";
    $("replay-pause").textContent = isPaused ? "Go on" : "Pause";
    const speed = $<HTMLSelectElement>("replay-speed");
    if (document.activeElement !== speed && [...speed.options].some((o) => o.value === state.speed)) speed.value = state.speed;
    $("replay-close").hidden = state.closes !== "true";
    $("replay-at").textContent = `${isPaused ? "paused at" : "at"} ${Number(state.position_s).toFixed(2)} s`;
  }
  show();
}

const isReplay = () => isServing() && store.status !== null && store.status.mode !== "run";

function show(): void {
  $("replay").hidden = !isReplay() || !isAllowed;
}

// Once a second: the replay advances, and other clients may control it.
export function updatePlayback(serving: boolean): void {
  const now = serving && store.scene && isReplay() ? serviceOf(store.scene) : "";
  if (now !== service) isAllowed = isKnown = false;
  service = now;
  if (now && store.scene!.may_teach && (isAllowed || !isKnown) && !asking) void send("state");
  show();
}

$("replay-pause").addEventListener("click", () => void send(isPaused ? "go" : "pause"));
$("replay-close").addEventListener("click", () => void ask("replay", "close"));
$("replay-step").addEventListener("click", () => void send("step"));
$("replay-step10").addEventListener("click", () => void send("step", "10"));
$<HTMLSelectElement>("replay-speed").addEventListener("change", (event) => void send("speed", (event.target as HTMLSelectElement).value));
