// The page: receives the bridge's events into the store and shows it.
import { arrange, drawNewPictures, forgetPictures, onNewPicture, redrawCameras, showPreview, slowness, updateCameras } from "./cameras";
import { colorOf } from "./color";
import type { CameraMap, CameraMapPoint, CameraPose, CameraTimes, ControlReply, HostClocks, Position, Pulse, Scene, State, Status, TeachReply } from "./messages";
import { drawPlots, isPaused, onPlotsChanged, plotPeriod, plotSpan, updatePlotTexts } from "./plots";
import { Scene3d } from "./scene3d";
import {
  client,
  forget,
  isConnecting, isServing,
  largestSigma,
  secondsOfSilence,
  store,
  takeCameraMap,
  takeCameraPose,
  takePosition,
  takeStatus,
  targetOf,
} from "./store";
import { drawAdjust, updateAdjust } from "./adjust";
import { updateCalibration } from "./calibrate";
import { drawControls, isRecorded, updateControls } from "./controls";
import { takeControlReply } from "./control";
import { updateCopyConfig } from "./copy_config";
import { updateNotices } from "./notices";
import { updatePlayback } from "./playback";
import { updateRecordings } from "./recordings";
import { remember, rememberChoice, setting } from "./settings";
import { isOpen, onLayout, onTool, restore } from "./shell";
import { updateSteps } from "./steps";
import { takeSceneForTeaching, takeTeachReply, updateTeach } from "./teach";
import { write } from "./text";
import { isHidden, watchVisibility } from "./visibility";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

// ---- Drawing: only what is new and visible, at a bounded rate.
interface Part {
  draw: () => void;
  period: () => number; // ms: it is drawn at multiples of it, so that parts that are due together make one picture of the page
  element: Element;
  isStale: boolean;
  drawnAt: number;
}
const parts: Part[] = [];
let asked = 0; // for a frame of the display
let timer = 0;

function addPart(element: Element, period: () => number, draw: () => void): Part {
  const part = { draw, period, element, isStale: true, drawnAt: -Infinity };
  parts.push(part);
  watchVisibility(element, schedule);
  return part;
}

const dueAt = (part: Part) => {
  const period = part.period();
  return period > 0 ? (Math.floor(part.drawnAt / period) + 1) * period : part.drawnAt;
};

function renew(...which: (Part | null)[]): void {
  for (const part of which) if (part) part.isStale = true;
  schedule();
}

function schedule(): void {
  if (asked || timer || document.hidden) return;
  const now = performance.now();
  const due = Math.min(...parts.filter((p) => p.isStale && !isHidden(p.element)).map(dueAt));
  if (due === Infinity) return;
  if (due <= now + 4) asked = requestAnimationFrame(frame);
  else
    timer = setTimeout(() => {
      timer = 0;
      asked ||= requestAnimationFrame(frame);
    }, due - now);
}

function frame(): void {
  asked = 0;
  const now = performance.now();
  for (const part of parts) {
    if (!part.isStale || isHidden(part.element) || dueAt(part) > now + 4) continue;
    part.isStale = false;
    part.drawnAt = now;
    part.draw();
  }
  schedule();
}

// ---- The stream. Hidden pages let go of it: browsers allow only a few connections to one host.
let events: EventSource | null = null;

function listen(): void {
  if (events || document.hidden) return;
  events = new EventSource(`/api/events?client=${client}`);
  const on = <T>(name: string, take: (message: T) => void) =>
    events!.addEventListener(name, (event) => {
      if (name !== "pulse") store.lifeAt = performance.now(); // the pulse is the bridge's
      take(JSON.parse((event as MessageEvent<string>).data) as T);
    });
  events.onopen = () => {
    forget(); // the bridge repeats what it has
    store.connected = true;
    store.connectedAt = performance.now();
    tick();
    renew(...parts);
  };
  events.onerror = () => {
    store.connectedAt = 0;
    store.connected = false; // EventSource tries again by itself, but for some answers of a server
    tick();
    renew(...parts);
    if (events?.readyState === EventSource.CLOSED) {
      hush();
      setTimeout(listen, 2000);
    }
  };
  on<Pulse>("pulse", (pulse) => (store.pulse = pulse));
  on<Status>("status", (status) => {
    const was = isServing();
    if (takeStatus(status)) forgetPictures();
    if (!was) tick();
    renew(cards);
  });
  on<Scene>("scene", (scene) => {
    store.scene = scene;
    takeSceneForTeaching(scene);
    tick();
    renew(...parts);
  });
  on<CameraTimes>("camera_times", (times) => (store.times = times));
  on<HostClocks>("host_clocks", (clocks) => (store.clocks = clocks));
  const onTracks = <T>(take: (message: T) => void) => (message: T) => {
    take(message);
    renew(cards, scenePart, isPaused() ? null : plotsPart);
  };
  on<Position>("position", onTracks(takePosition));
  on<CameraPose>("camera_pose", onTracks(takeCameraPose));
  on<CameraMap>("camera_map", onTracks(takeCameraMap));
  on<Parameters<typeof showPreview>[0]>("preview", (preview) => void showPreview(preview));
  on<ControlReply>("control", takeControlReply);
  on<TeachReply>("teach", (reply) => void takeTeachReply(reply));
}

function hush(): void {
  events?.close();
  events = null;
}

document.addEventListener("visibilitychange", () => {
  if (document.hidden) hush();
  else listen();
  schedule();
});

// ---- Targets
const stateText: Record<State, string> = {
  searching: "not found yet",
  tracking: "measured and certain",
  coasting: "predicted, or seen by too few cameras",
  lost: "not seen for too long; it is searched for",
};
const announced = new Map<string, State>();

// Tooltips of a card's figures.
const meanings: Record<string, string> = {
  "1σ": "Standard deviation of the position along its most uncertain direction",
  Speed: "Speed of the object",
  Views: "Cameras that see it, of those that delivered a frame",
  Confidence: "Probability that it is the object",
  Latency: "From the capture of the picture to the publication of the position",
  Features: "Points of the map that were found in the last frame, of those in view",
  "Map points": "Number of points in the map",
};
function explain(card: HTMLElement): void {
  for (const term of card.querySelectorAll("dt")) term.parentElement!.title = meanings[term.textContent!] ?? "";
}

// processing: from the arrival of the pictures' last byte on, s.
function explainLatency(card: HTMLElement, processing: number | null): void {
  const title = meanings.Latency + (processing === null ? "" : `; ${(processing * 1000).toFixed(1)} ms of it after the last byte of the pictures had arrived`);
  const figure = card.querySelector(".latency")!.parentElement!;
  if (figure.title !== title) figure.title = title;
}

function cardOf(name: string): HTMLElement {
  const list = $("targets");
  for (const card of list.children) if ((card as HTMLElement).dataset.target === name) return card as HTMLElement;
  const card = document.createElement("li");
  card.dataset.target = name;
  card.innerHTML = `<h3><span class="swatch" aria-hidden="true"></span><span class="name"></span><span class="state"></span></h3>
    <p class="position"><span data-axis="x"></span><span data-axis="y"></span><span data-axis="z"></span><span class="unit">m</span></p>
    <dl><div><dt>1σ</dt><dd class="sigma"></dd></div><div><dt>Speed</dt><dd class="speed"></dd></div>
    <div><dt>Views</dt><dd class="views"></dd></div><div><dt>Confidence</dt><dd class="confidence"></dd></div>
    <div><dt>Latency</dt><dd class="latency"></dd></div></dl><p class="why"></p>`;
  card.querySelector(".name")!.textContent = name;
  explain(card);
  list.append(card);
  return card;
}

// ---- Problems of a position: the figure, its severity, and a sentence.
interface Issue {
  figure: "sigma" | "views" | "confidence" | "latency" | "state";
  level: "warn" | "bad";
  why: string;
}
// A delay of 0.1 s is visible; after 0.5 s the object is elsewhere.
const lateLatency = 0.1; // s
const uselessLatency = 0.5;
const otherClock = 3600; // larger: not the same clock (a replay publishes its recording's times)
const lowConfidence = 0.5;

const radiusOf = (name: string) => {
  const targets = store.scene?.targets ?? [];
  return targets.find((t) => t.name === targetOf(name, targets.map((t) => t.name)))?.radius ?? Infinity;
};

function issuesOf(latest: Position, sigma: number): Issue[] {
  const issues: Issue[] = [];
  if (latest.state !== "tracking") issues.push({ figure: "state", level: latest.state === "lost" ? "bad" : "warn", why: `${latest.state}: ${stateText[latest.state]}` });
  const isLate = Math.abs(latest.latency) < otherClock && latest.latency > lateLatency;
  // A replay that is slowed or was paused falls behind its times, and nothing is wrong.
  if (isLate && store.status?.mode !== "run")
    issues.push({ figure: "latency", level: "warn", why: `the replay is ${latest.latency.toFixed(2)} s behind its own times: it was paused, is slowed, or the machine is busy` });
  else if (isLate)
    issues.push({
      figure: "latency",
      level: latest.latency > uselessLatency ? "bad" : "warn",
      why: `its positions are ${latest.latency.toFixed(2)} s late: the machine is too slow, or a camera's time stamps are wrong`,
    });
  if (sigma > radiusOf(latest.target)) issues.push({ figure: "sigma", level: "warn", why: "its uncertainty exceeds its own radius" });
  const silent = latest.per_view.filter((v) => !v.delivered).map((v) => v.camera);
  if (latest.state === "tracking" && latest.views === 1)
    issues.push({ figure: "views", level: "warn", why: `only ${latest.per_view.find((v) => v.seen)?.camera ?? "one camera"} sees it` });
  else if (silent.length) issues.push({ figure: "views", level: "warn", why: `no frame from ${silent.join(", ")}` });
  if (latest.state === "tracking" && latest.confidence < lowConfidence)
    issues.push({ figure: "confidence", level: "warn", why: "the cameras hardly see it" });
  return issues;
}

function updateTargets(): void {
  const now = performance.now();
  for (const card of [...$("targets").children] as HTMLElement[])
    if (!store.targets.has(card.dataset.target!) && !store.trackedCameras.has(card.dataset.camera ?? "")) card.remove();
  for (const target of store.targets.values()) {
    const card = cardOf(target.name);
    const { latest } = target;
    const fresh = isServing() && now - target.receivedAt < 2000;
    card.dataset.state = fresh ? latest.state : "none";
    const text = (selector: string, value: string) => write(card.querySelector(selector)!, value);
    const swatch = card.querySelector(".swatch") as HTMLElement;
    if (swatch.dataset.color !== colorOf(target.name)) swatch.style.background = swatch.dataset.color = colorOf(target.name);
    const isHeld = isServing() && store.status?.mode === "held";
    text(".state", fresh ? latest.state : isHeld ? "paused" : "no news");
    const title = fresh ? stateText[latest.state] : isHeld ? "the replay is paused: press Go on" : "no sample for two seconds";
    const state = card.querySelector(".state") as HTMLElement;
    if (state.title !== title) state.title = title;
    latest.position.forEach((value, i) => {
      text(`[data-axis=${"xyz"[i]}]`, `${"xyz"[i]} ${value === null || !fresh ? "–" : value.toFixed(3)}`);
    });
    const sample = target.history.at(-1);
    const has = fresh && sample?.p;
    text(".sigma", has ? `${(sample.sigma * 1000).toFixed(1)} mm` : "–");
    text(".speed", has ? `${sample.speed.toFixed(2)} m/s` : "–");
    text(".views", fresh ? `${latest.views} of ${latest.per_view.length}` : "–");
    text(".confidence", fresh ? `${Math.round(latest.confidence * 100)} %` : "–");
    text(".latency", fresh && Math.abs(latest.latency) < otherClock ? `${(latest.latency * 1000).toFixed(1)} ms` : "–");
    explainLatency(card, fresh ? latest.tracking_latency : null);
    const issues = fresh ? issuesOf(latest, has ? sample.sigma : NaN) : [];
    for (const figure of ["sigma", "views", "confidence", "latency"] as const) {
      const level = issues.find((d) => d.figure === figure)?.level ?? "";
      const element = card.querySelector(`.${figure}`) as HTMLElement;
      if ((element.dataset.level ?? "") !== level) element.dataset.level = level;
    }
    const sentence = issues.map((d) => d.why).join("; ");
    text(".why", sentence ? sentence[0].toUpperCase() + sentence.slice(1) + "." : fresh ? "" : isHeld ? "" : "No sample for two seconds.");
    if (fresh) announceState(target.name, latest.state);
  }
  const list = $("targets");
  const inOrder = [...store.targets.keys()].map(cardOf);
  if (inOrder.some((card, i) => list.children[i] !== card)) list.prepend(...inOrder);
  if (inOrder.length) $("no-targets").hidden = true;
  if (inOrder.length !== fittedCount) fitTargets();
}

// For screen readers.
function announceState(name: string, state: State): void {
  if (announced.get(name) === state) return;
  if (announced.has(name)) $("news").textContent = `${name} is ${state}`;
  announced.set(name, state);
}

// As much of each card as lets all positions be seen at once: all figures, those in a line, none, or one line in all.
const densities = ["full", "tight", "compact", "dense"];
let fittedFor = "";
let fittedCount = -1;
let fittedAt = -Infinity;
function fitTargets(): void {
  const list = $("targets");
  const stage = $("stage");
  const now = [list.children.length, stage.clientWidth, stage.clientHeight, stage.dataset.cameras, stage.style.cssText, document.body.dataset.drawer].join();
  // Fuller only in another layout, or after some seconds: a sentence that comes and goes does not change it back and forth.
  const isSame = now === fittedFor && performance.now() - fittedAt < 10000;
  const first = isSame ? densities.indexOf(list.dataset.density ?? "full") : 0;
  if (!isSame) fittedAt = performance.now();
  fittedFor = now;
  fittedCount = store.targets.size;
  for (const density of densities.slice(first)) {
    if (list.dataset.density !== density) list.dataset.density = density;
    if (list.scrollHeight <= list.clientHeight + 1) return;
  }
}

const mapStates: Record<CameraMapPoint["state"], string> = {
  found: "found",
  missed: "missed",
  not_sought: "not in view",
};
const sigmaOf = (p: CameraMapPoint) =>
  largestSigma([0, 1, 2, 1, 3, 4, 2, 4, 5].map((i) => p.covariance[i]));

function updateTrackedCameras(): void {
  $("map-key").hidden = ![...store.trackedCameras.values()].some((c) => c.map?.points.length);
  for (const [name, camera] of store.trackedCameras) {
    let card = [...$("targets").children].find((c) => (c as HTMLElement).dataset.camera === name) as HTMLElement;
    if (!card) {
      card = document.createElement("li");
      card.dataset.camera = name;
      card.innerHTML = `<h3><span aria-hidden="true">◉</span><span class="name"></span><span class="state"></span></h3>
        <p class="position"><span data-axis="x"></span><span data-axis="y"></span><span data-axis="z"></span><span class="unit">m</span></p>
        <dl><div><dt>1σ</dt><dd class="sigma"></dd></div><div><dt>Features</dt><dd class="features"></dd></div>
        <div><dt>Map points</dt><dd class="map"></dd></div><div><dt>Confidence</dt><dd class="confidence"></dd></div>
        <div><dt>Latency</dt><dd class="latency"></dd></div></dl>
        <details hidden><summary></summary><div class="scroll tall" tabindex="0" role="region"><table>
        <thead><tr><th scope="col">Point</th><th scope="col">x m</th><th scope="col">y m</th><th scope="col">z m</th><th scope="col">1σ mm</th><th scope="col">Last frame</th></tr></thead>
        <tbody></tbody></table></div></details>`;
      card.querySelector(".name")!.textContent = `camera ${name}`;
      card.querySelector(".scroll")!.setAttribute("aria-label", `Map points of camera ${name}`);
      card.querySelector("details")!.addEventListener("toggle", () => renew(cards));
      explain(card);
      $("targets").append(card);
    }
    const { latest, map } = camera;
    const fresh = isServing() && latest !== null && performance.now() - camera.receivedAt < 2000;
    card.dataset.state = fresh ? latest.state : "none";
    const text = (selector: string, value: string) => write(card.querySelector(selector)!, value);
    text(".state", fresh ? latest.state : "no news");
    for (const [i, axis] of ["x", "y", "z"].entries()) {
      const v = fresh ? latest.position[i] : null;
      text(`[data-axis=${axis}]`, `${axis} ${v === null ? "–" : v.toFixed(3)}`);
    }
    const sigma = fresh ? Math.max(...latest.sigma.map((s) => s ?? NaN)) : NaN;
    text(".sigma", Number.isFinite(sigma) ? `${(sigma * 1000).toFixed(1)} mm` : "–");
    text(".features", fresh ? `${latest.features_matched} of ${latest.features_in_view}` : "–");
    text(".map", fresh ? String(latest.map_points) : "–");
    text(".confidence", fresh ? `${Math.round(latest.confidence * 100)} %` : "–");
    text(".latency", fresh ? `${(latest.latency * 1000).toFixed(1)} ms` : "–");
    explainLatency(card, fresh ? latest.tracking_latency : null);
    if (fresh) announceState(`camera ${name}`, latest.state);
    const details = card.querySelector("details")!;
    details.hidden = !map || map.points.length === 0;
    if (!map) continue;
    const found = map.points.filter((p) => p.state === "found").length;
    const sigmas = map.points.map(sigmaOf).filter(Number.isFinite).sort((a, b) => a - b);
    text(
      "summary",
      `Map: ${map.map_points} points, ${found} found in the last frame` +
        (sigmas.length ? `, median 1σ ${(sigmas[sigmas.length >> 1] * 1000).toFixed(1)} mm` : ""),
    );
    const body = card.querySelector("tbody")!;
    if (!details.open || body.dataset.at === String(map.t)) continue;
    body.dataset.at = String(map.t);
    body.replaceChildren(
      ...map.points.map((p) => {
        const row = document.createElement("tr");
        const cells = [
          `${p.id}${p.given ? " (given)" : ""}`,
          ...p.position.map((v) => (v === null ? "–" : v.toFixed(3))),
          Number.isFinite(sigmaOf(p)) ? (sigmaOf(p) * 1000).toFixed(1) : "–",
          mapStates[p.state] ?? p.state,
        ];
        row.append(...cells.map((c) => Object.assign(document.createElement("td"), { textContent: c })));
        return row;
      }),
    );
  }
}

// ---- Header, warnings, health: once a second, and when the connection changes
function tick(): void {
  const serving = isServing();
  const { status, pulse } = store;
  const link = $("link");
  const justBegun = store.rates.length < 3; // statuses: no rate is known yet
  const isStuck = serving && !justBegun && status!.mode === "run" && status!.set_rate_hz < 0.05;
  const connecting = isConnecting();
  link.dataset.link = connecting ? "warn" : !store.connected ? "bad" : serving && !isStuck ? "good" : "warn";
  write(link, connecting ? "Connecting" : !store.connected ? "No bridge" : serving ? (status!.mode !== "run" ? "Replay" : isRecorded() ? "Playing" : "Live") : "No service");
  const service = connecting
    ? ""
    : !store.connected
    ? "The bridge does not answer. Trying again."
    : serving
      ? status!.mode === "held"
        ? `replay on ${status!.host}, paused: Go on continues it`
        : `${status!.mode !== "run" ? "replay" : isRecorded() ? "a recording, played as if live," : "live cameras"} on ${status!.host}, ${isStuck ? "no frame sets: do all cameras deliver?" : `${status!.set_rate_hz.toFixed(1)} sets/s`}`
      : `Waiting for huetrackd on ${pulse ? pulse.bus : "DDS"}. The page continues automatically.`;
  write($("service"), service);
  updateNotices();
  write($("targets-title"), store.trackedCameras.size === 0 ? "Targets" : store.targets.size === 0 ? "Tracked camera" : "Targets and tracked camera");
  $("no-targets").hidden = store.targets.size + store.trackedCameras.size > 0;
  write($("no-targets"), awaited(serving));
  const hasPlaces = store.scene !== null && (store.scene.cameras.some((c) => c.model) || store.trackedCameras.size > 0);
  $("no-scene").hidden = hasPlaces || canvas.hidden;
  canvas.classList.toggle("bare", !hasPlaces); // hides an empty scene
  write($("no-scene"), store.scene
    ? "The cameras' poses are unknown: they are drawn here after the calibration."
    : "Cameras, volume and targets are drawn here once a service publishes them.");
  write($("no-cameras"), serving || connecting ? "Pictures are awaited; they come while this page is looked at." : "No service sends pictures.");
  updateCameras(serving);
  fitTargets();
  updateHealth(serving);
  updatePlotTexts();
  updateTeach(serving);
  updateAdjust(serving);
  updateControls(serving);
  updateCalibration(serving);
  updatePlayback(serving);
  updateRecordings();
  updateCopyConfig();
  updateSteps();
}

// Why there is no position yet.
function awaited(serving: boolean): string {
  const { status, pulse } = store;
  if (isConnecting()) return "";
  if (!store.connected) return "Positions continue when the bridge is back.";
  if (!serving || !status)
    return `No huetrackd was found on DDS domain ${pulse?.domain ?? 0}. Start says how to start one.`;
  if (status.mode === "held") return "The replay is paused. Go on, above, lets it run.";
  const there = status.cameras.filter((c) => c.health === "delivering").length;
  if (status.cameras.length && there < status.cameras.length)
    return `No position yet: ${there} of ${status.cameras.length} cameras deliver. Health says what the others lack.`;
  if (store.scene?.cameras.some((c) => !c.model)) return "Nothing is tracked before the cameras are calibrated.";
  return status.targets.length ? `No position of ${status.targets.join(", ")} yet.` : "The configuration names no target.";
}

// The camera's timing, as estimated from the targets' motion.
function timesOf(camera: string): string {
  const { status, times } = store;
  if (!status || !times || times.host !== status.host || times.pid !== status.pid) return "";
  const index = times.cameras.findIndex((c) => c.name === camera);
  if (index < 0) return "";
  const time = times.cameras[index];
  const ms = (seconds: number) => (Math.round(10000 * seconds) / 10 || 0).toFixed(1); // never "-0.0"
  const sure = index === 0 ? "(held)" : `± ${ms(time.latency_sigma_s)}`;
  return `latency ${ms(time.latency_s)} ms ${sure}, readout ${ms(time.readout_s)} ms ± ${ms(time.readout_sigma_s)}`;
}

// The clock of a remote camera's host.
function clockOf(camera: string): string {
  const { status, clocks } = store;
  if (!status || !clocks || clocks.host !== status.host || clocks.pid !== status.pid) return "";
  const clock = clocks.clocks.find((c) => c.cameras.includes(camera));
  if (!clock) return "";
  if (!clock.known) return `clock of ${clock.host} unknown`;
  if (clock.same_machine) return "clock is ours";
  const ahead = `${(1000 * Math.abs(clock.offset_s)).toFixed(2)} ms ${clock.offset_s < 0 ? "behind" : "ahead"}`;
  return `clock of ${clock.host} ${ahead} ± ${(1000 * clock.sigma_s).toFixed(2)}, drifts by ${clock.drift_ppm.toFixed(0)} ppm`;
}

function fact(name: string, value: string, level = ""): HTMLElement {
  const div = document.createElement("div");
  const figure = Object.assign(document.createElement("dd"), { textContent: value });
  if (level) figure.dataset.level = level;
  div.append(Object.assign(document.createElement("dt"), { textContent: name }), figure);
  return div;
}

function updateHealth(serving: boolean): void {
  if (!isOpen("health")) return;
  const { status } = store;
  $("health").replaceChildren(
    ...(status?.cameras ?? []).map((camera) => {
      const isHeld = serving && status!.mode === "held";
      const slow = serving && !isHeld ? slowness(camera) : "";
      const item = document.createElement("li");
      item.dataset.camera = camera.name;
      item.innerHTML = `<h3><span class="name"></span><span class="chip"></span></h3><dl></dl>`;
      item.querySelector(".name")!.textContent = camera.name;
      const chip = item.querySelector<HTMLElement>(".chip")!;
      chip.dataset.health = isHeld ? "held" : serving ? camera.health : "unknown";
      chip.textContent = isHeld ? "paused" : chip.dataset.health;
      item.querySelector("dl")!.append(
        ...[
          ["Frames a second", camera.rate_hz.toFixed(1), slow ? "warn" : ""],
          ["Frames", String(camera.frames), ""],
          ["Dropped", String(camera.dropped), camera.dropped ? "warn" : ""],
          ["Damaged", String(camera.corrupted), camera.corrupted ? "warn" : ""],
        ].map(([name, value, level]) => fact(name, value, level)),
      );
      const line = (text: string, isBad: boolean) => text && item.append(Object.assign(document.createElement("p"), { textContent: text, className: isBad ? "bad" : "" }));
      line([timesOf(camera.name), clockOf(camera.name)].filter(Boolean).join("; "), false);
      line(isHeld ? "" : [camera.message, slow].filter(Boolean).join("; "), true);
      return item;
    }),
  );
  const facts: [string, string][] = status
    ? [
        ["Configuration", `${status.config_file} (${status.config_identity})`],
        ["Rig", status.rig_history ? `${status.rig_identity}, ${status.rig_history}` : status.rig_identity],
        ["Version", status.version],
        ["Frame sets", `${status.sets} tracked, ${status.incomplete_sets} incomplete, ${status.dropped_sets} dropped`],
        ["Late frames", String(status.late_frames)],
        ["Samples", `${status.published} published, ${status.publish_failures} failures`],
        ["Process", `${status.pid} on ${status.host}`],
        ["Bus", store.pulse?.bus ?? ""],
      ]
    : [];
  $("facts").replaceChildren(...facts.map(([name, value]) => fact(name, value)));
}

onTool("health", { opened: () => updateHealth(isServing()) });

// ---- Theme: the system's, unless the user chose
const theme = $("theme") as HTMLButtonElement;
const systemDark = matchMedia("(prefers-color-scheme: dark)");
function applyTheme(): void {
  const chosen = setting("theme", "");
  const dark = chosen ? chosen === "dark" : systemDark.matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  theme.textContent = dark ? "Light" : "Dark";
  theme.setAttribute("aria-label", `Switch to ${dark ? "light" : "dark"} colours`);
  renew(...parts);
}
theme.addEventListener("click", () => {
  remember("theme", document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  applyTheme();
});
systemDark.addEventListener("change", applyTheme);
applyTheme();

// ---- The parts
// A readable rate of the figures. Without a graphics card every change costs much of a core: then all parts change at once, just often
// enough to show the motion.
const slowBeat = 160; // ms
const isSlow = () => scene3d?.isSlow ?? false;
let scene3d: Scene3d | null = null;
// Also while invisible: they are read aloud.
const cards = addPart(document.body, () => (isSlow() ? slowBeat : 100), () => {
  updateTargets();
  updateTrackedCameras();
});

const pictures = addPart($("cameras"), () => (isSlow() ? slowBeat : 0), drawNewPictures);
const setup = addPart($("controls-panel"), () => (isSlow() ? slowBeat : 0), drawControls);
const mask = addPart($("adjust-panel"), () => (isSlow() ? slowBeat : 0), drawAdjust);
onNewPicture(() => renew(pictures, setup, mask));

let scenePart: Part | null = null;
const canvas = $("scene") as HTMLCanvasElement;
let turnedAt = -Infinity;
try {
  const view = new Scene3d(canvas);
  scene3d = view;
  // Faster while the user turns it.
  const period = () => (!view.isSlow ? 0 : performance.now() - turnedAt < 400 ? 40 : slowBeat);
  scenePart = addPart(canvas, period, () => view.render());
  view.onTurned = () => {
    turnedAt = performance.now();
    renew(scenePart);
  };
  $("home").addEventListener("click", () => {
    view.home();
    renew(scenePart);
  });
} catch (error) {
  // A browser without WebGL shows everything else.
  canvas.hidden = true;
  $("no-webgl").hidden = false;
  console.warn("no 3-D view:", error);
}

let plotsAsked = false; // by the user: without delay
const plotsPart = addPart(
  $("plots").parentElement!,
  () => (plotsAsked ? 30 : Math.max(plotPeriod(), isSlow() ? 2 * slowBeat : 100)),
  () => {
    plotsAsked = false;
    drawPlots();
  },
);
onPlotsChanged(() => {
  plotsAsked = true;
  renew(plotsPart);
});

// Of the stage and of what is in it: the window, the drawer and the plots change it.
function layOut(): void {
  arrange();
  fitTargets();
  redrawCameras();
  renew(...parts);
}
onLayout(layOut);
new ResizeObserver(layOut).observe($("stage"));
addEventListener("resize", layOut);
rememberChoice($<HTMLSelectElement>("plot-span"));
// Without samples, states become stale and the plots' time axis advances until they are empty.
setInterval(() => {
  tick();
  if (secondsOfSilence() < plotSpan() + 3) renew(...parts.filter((part) => part !== plotsPart || !isPaused()));
}, 1000);
restore();
listen();
tick();
renew(...parts);
