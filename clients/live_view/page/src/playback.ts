// Controls of a replay: pause, step, speed.
import { ask } from "./control";
import { isServing, serviceOf, store } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

let service = ""; // of the shown state
let isAllowed = false;
let isKnown = false; // whether it is
let isPaused = false;
let positionAt = { s: NaN, at: 0 }; // of the last answer, and performance.now() then
let length = NaN; // s; NaN: unknown
let isBound = false; // its times must not jump
let isSeeking = false; // by the slider, now
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
    const position = Number(state.position_s);
    positionAt = { s: position, at: performance.now() };
    length = state.seeks === "true" ? Number(state.length_s || NaN) : NaN;
    isBound = state.seeks === "false";
    const of = length > 0 ? ` of ${length.toFixed(1)}` : "";
    $("replay-at").textContent = `${isPaused ? "paused at" : "at"} ${position.toFixed(2)}${of} s`;
    showSeek(position);
  }
  show();
}

function showSeek(position: number): void {
  const slider = $<HTMLInputElement>("replay-seek");
  slider.hidden = !(length > 0);
  $("replay-why").hidden = !isBound;
  if (isSeeking || slider.hidden) return;
  slider.max = String(length);
  slider.value = String(position);
}

// The recording's time of a moment that is so many seconds before the newest sample; NaN: no replay, or its speed is unknown.
export function recordedAt(secondsBefore: number): number {
  return isReplay() && isAllowed ? positionAt.s + (isPaused ? 0 : (performance.now() - positionAt.at) / 1000) * shownSpeed() - secondsBefore : NaN;
}
const shownSpeed = () => (Number.isFinite(Number($<HTMLSelectElement>("replay-speed").value)) ? Number($<HTMLSelectElement>("replay-speed").value) : 0);
export const canSeek = () => isReplay() && isAllowed && length > 0;
export const seekTo = (seconds: number) => void send("seek", Math.min(Math.max(0, seconds), length).toFixed(2));

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

const slider = $<HTMLInputElement>("replay-seek");
slider.addEventListener("input", () => {
  isSeeking = true;
  $("replay-at").textContent = `to ${Number(slider.value).toFixed(2)} of ${length.toFixed(1)} s`;
});
slider.addEventListener("change", () => {
  isSeeking = false;
  seekTo(Number(slider.value));
});
$("replay-pause").addEventListener("click", () => void send(isPaused ? "go" : "pause"));
$("replay-close").addEventListener("click", () => void ask("replay", "close"));
$("replay-step").addEventListener("click", () => void send("step"));
$("replay-step10").addEventListener("click", () => void send("step", "10"));
$<HTMLSelectElement>("replay-speed").addEventListener("change", (event) => void send("speed", (event.target as HTMLSelectElement).value));
