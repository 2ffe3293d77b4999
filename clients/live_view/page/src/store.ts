// The page's state. Views read it; nothing here touches the document.
import type { CameraMap, CameraPose, CameraTimes, HostClocks, N, Position, Pulse, Scene, State, Status } from "./messages";

export const historySeconds = 600;

export interface Sample {
  t: number;
  state: State;
  p: [number, number, number] | null;
  sigma: number; // largest axis, m; NaN without a position
  speed: number;
  latency: number;
  processing: number; // s, the part of the latency from the arrival of the pictures' last byte on
  residual: number; // px, of the worst view; NaN: none, or of a camera
  features: number; // matched; NaN of a target
  columns: N[]; // of the log's CSV: those between the time and the state
  counts: number[]; // and those after the state
}

// How well a camera's view fits what is tracked, at one moment.
export interface ViewSample {
  t: number;
  residual: number; // px, of the object that fits worst
}

// From the status, once a second.
export interface Rates {
  t: number;
  rate: number; // frame sets a second
  cameras: Map<string, number>; // frames a second
}

export interface Target {
  name: string;
  latest: Position;
  receivedAt: number; // performance.now()
  history: Sample[];
}

export interface TrackedCamera {
  latest: CameraPose | null;
  receivedAt: number;
  history: Sample[];
  map: CameraMap | null;
}

// This page's name for the bridge: replies to its requests carry it.
export const client = Array.from(crypto.getRandomValues(new Uint8Array(8)), (b) => b.toString(16).padStart(2, "0")).join("");

export const store = {
  connected: false, // to the bridge
  connectedAt: Infinity, // performance.now(); Infinity: not yet; 0: the connection broke
  pulse: null as Pulse | null,
  status: null as Status | null,
  times: null as CameraTimes | null,
  clocks: null as HostClocks | null,
  statusHeard: 0,
  lifeAt: 0, // performance.now() of the last message of the service, of any kind
  scene: null as Scene | null,
  targets: new Map<string, Target>(),
  trackedCameras: new Map<string, TrackedCamera>(),
  views: new Map<string, ViewSample[]>(), // by camera
  rates: [] as Rates[],
};

const length = (v: (number | null)[]) => Math.hypot(...v.map((x) => x ?? NaN));

// The square root of the largest eigenvalue of a symmetric 3x3 matrix, row by row.
export function largestSigma(c: (number | null)[]): number {
  if (c.some((x) => x === null)) return NaN;
  const m = c as number[];
  let v = [1, 0.7, 0.4];
  for (let i = 0; i < 30; i++) {
    const w = [0, 1, 2].map((r) => m[3 * r] * v[0] + m[3 * r + 1] * v[1] + m[3 * r + 2] * v[2]);
    const n = Math.hypot(...w) || 1;
    v = w.map((x) => x / n);
  }
  const w = [0, 1, 2].map((r) => m[3 * r] * v[0] + m[3 * r + 1] * v[1] + m[3 * r + 2] * v[2]);
  return Math.sqrt(Math.max(0, w[0] * v[0] + w[1] * v[1] + w[2] * v[2]));
}

// Of a symmetric matrix of n rows, row by row.
const upperTriangle = (matrix: N[], n: number): N[] => matrix.filter((_, i) => i % n >= Math.floor(i / n));

export function takePosition(sample: Position): void {
  let target = store.targets.get(sample.target);
  if (!target) {
    target = { name: sample.target, latest: sample, receivedAt: 0, history: [] };
    store.targets.set(sample.target, target);
  }
  const last = target.history.at(-1);
  if (last && sample.t <= last.t) {
    if (sample.t > last.t - 1) return; // again, or out of order
    target.history = []; // another service, another clock
  }
  target.latest = sample;
  target.receivedAt = performance.now();
  const [x, y, z] = sample.position;
  target.history.push({
    t: sample.t,
    state: sample.state,
    p: x === null || y === null || z === null ? null : [x, y, z],
    sigma: largestSigma(sample.covariance),
    speed: length(sample.velocity),
    latency: sample.latency,
    processing: sample.tracking_latency,
    residual: largestResidual(sample),
    features: NaN,
    columns: [...sample.position, ...sample.velocity, ...upperTriangle(sample.covariance, 3)],
    counts: [sample.views, sample.confidence],
  });
  forgetOld(target.history);
  takeViews(sample);
}

// Several targets have samples of the same frames: keeps the largest residual of each moment.
function takeViews(sample: Position): void {
  for (const { camera, seen, residual_px: residual } of sample.per_view) {
    if (!seen || !Number.isFinite(residual)) continue;
    let samples = store.views.get(camera) ?? [];
    const last = samples.at(-1);
    if (last && sample.t < last.t - 1) samples = []; // another service, another clock
    if (samples.at(-1)?.t === sample.t) last!.residual = Math.max(last!.residual, residual);
    else if (!samples.length || sample.t > last!.t) samples.push({ t: sample.t, residual });
    store.views.set(camera, samples);
    forgetOld(samples);
  }
}

function largestResidual(sample: Position): number {
  let most = NaN;
  for (const view of sample.per_view) if (view.seen && Number.isFinite(view.residual_px) && !(most >= view.residual_px)) most = view.residual_px;
  return most;
}

// The first that is not before t, of ascending times.
export function indexAt(samples: { t: number }[], t: number): number {
  let [low, high] = [0, samples.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (samples[middle].t < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

// Of the last seconds that there are.
export function lately<S extends { t: number }>(samples: S[], seconds: number): S[] {
  return samples.length ? samples.slice(indexAt(samples, samples[samples.length - 1].t - seconds)) : [];
}

function forgetOld(history: { t: number }[]): void {
  const old = indexAt(history, history[history.length - 1].t - historySeconds);
  if (old > 60) history.splice(0, old);
}

function trackedCamera(name: string): TrackedCamera {
  let camera = store.trackedCameras.get(name);
  if (!camera) {
    camera = { latest: null, receivedAt: 0, history: [], map: null };
    store.trackedCameras.set(name, camera);
  }
  return camera;
}

export function takeCameraMap(map: CameraMap): void {
  if (store.status && isServing() && !isOf(store.status, map)) return;
  trackedCamera(map.camera).map = map;
}

export function takeCameraPose(sample: CameraPose): void {
  const camera = trackedCamera(sample.camera);
  if (camera.history.length && sample.t === camera.history.at(-1)!.t) return; // again
  if (camera.history.length && sample.t < camera.history.at(-1)!.t) camera.history = [];
  camera.latest = sample;
  camera.receivedAt = performance.now();
  const [x, y, z] = sample.position;
  const p: Sample["p"] = x === null || y === null || z === null ? null : [x, y, z];
  const before = camera.history.at(-1);
  const moved = p && before?.p ? Math.hypot(p[0] - before.p[0], p[1] - before.p[1], p[2] - before.p[2]) : NaN;
  camera.history.push({
    t: sample.t,
    state: sample.state,
    p,
    sigma: p ? Math.max(...sample.sigma.map((s) => s ?? NaN)) : NaN,
    speed: before && sample.t > before.t ? moved / (sample.t - before.t) : NaN,
    latency: sample.latency,
    processing: sample.tracking_latency,
    residual: NaN,
    features: sample.features_matched,
    columns: [...sample.position, ...sample.orientation, ...upperTriangle(sample.covariance, 6)],
    counts: [sample.features_in_view, sample.features_matched, sample.confidence],
  });
  forgetOld(camera.history);
}

// Everything that has a position: targets, then tracked cameras.
export function tracks(): { name: string; isCamera: boolean; history: Sample[] }[] {
  return [
    ...[...store.targets.values()].map((t) => ({ name: t.name, isCamera: false, history: t.history })),
    ...[...store.trackedCameras].map(([name, c]) => ({ name, isCamera: true, history: c.history })),
  ];
}

const isOf = (status: Status, other: { host: string; pid: number }) => other.host === status.host && other.pid === status.pid;

// Returns whether it is of another service or rig, which invalidates everything shown.
export function takeStatus(status: Status): boolean {
  const isOther = !!store.status && (!isOf(store.status, status) || store.status.rig_identity !== status.rig_identity);
  if (isOther) {
    forget();
    if (store.scene && !isOf(status, store.scene)) store.scene = null;
  }
  for (const [name, camera] of store.trackedCameras) if (camera.map && !isOf(status, camera.map)) store.trackedCameras.delete(name);
  store.status = status;
  store.statusHeard = performance.now();
  store.rates.push({ t: status.heard, rate: status.set_rate_hz, cameras: new Map(status.cameras.map((c) => [c.name, c.rate_hz])) });
  forgetOld(store.rates);
  for (const [name, target] of store.targets) {
    const isEnded = !status.targets.includes(name) && target.latest.state === "lost";
    if (isEnded || !status.targets.includes(targetOf(name, status.targets))) store.targets.delete(name);
  }
  // In the configuration's order. For a target of several objects its objects by number, or the target itself while there are none.
  const order = status.targets.flatMap((target) => {
    const objects = [...store.targets.keys()].filter((name) => name !== target && targetOf(name, status.targets) === target);
    const number = (name: string) => Number(name.slice(target.length + 1));
    return objects.length > 0 ? objects.sort((a, b) => number(a) - number(b)) : store.targets.has(target) ? [target] : [];
  });
  if (order.join("\n") !== [...store.targets.keys()].join("\n"))
    store.targets = new Map(order.map((name) => [name, store.targets.get(name)!]));
  return isOther;
}

// The target that a name is of: its own, or that of the object "ball_3".
export function targetOf(name: string, targets: string[]): string {
  if (targets.includes(name)) return name;
  const target = name.replace(/_\d+$/, "");
  return targets.includes(target) ? target : name;
}

// Identifies one run of a service.
export const serviceOf = (scene: Scene): string => `${scene.host}/${scene.pid}`;

// Whether the service accepts changes.
export const mayChange = (): boolean => !!store.scene?.may_teach;

export function isServing(): boolean {
  return store.connected && store.status !== null && performance.now() - store.statusHeard < 4000;
}

// For a moment after the page or its connection began: the bridge has not reported a service yet.
export const settled = 2000; // ms
export const isConnecting = (): boolean => !isServing() && performance.now() - store.connectedAt < settled;
// Why nothing can be done.
export const withoutService = (): string => (isConnecting() ? "Connecting…" : "No service is connected.");

// Since the last position or pose of all; Infinity: there was none.
export function secondsOfSilence(): number {
  const receivedAt = Math.max(-Infinity, ...[...store.targets.values(), ...store.trackedCameras.values()].map((track) => track.receivedAt));
  return (performance.now() - receivedAt) / 1000;
}

export function forget(): void {
  store.targets.clear();
  store.trackedCameras.clear();
  store.views.clear();
  store.rates = [];
}
