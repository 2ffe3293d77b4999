// What the page knows. The views read it; nothing here touches the document.
import type { CameraPose, Position, Pulse, Scene, State, Status } from "./messages";

export const historySeconds = 30;

export interface Sample {
  t: number;
  state: State;
  p: [number, number, number] | null;
  sigma: number; // largest axis, m; NaN without a position
  speed: number;
  latency: number;
  ess: number;
  share: number; // ess of the particles
}

export interface Target {
  name: string;
  latest: Position;
  heard: number; // performance.now()
  history: Sample[];
}

export interface TrackedCamera {
  latest: CameraPose;
  heard: number;
  trail: { t: number; p: [number, number, number] | null }[];
}

export const store = {
  connected: false, // to the bridge
  pulse: null as Pulse | null,
  status: null as Status | null,
  statusHeard: 0,
  scene: null as Scene | null,
  targets: new Map<string, Target>(),
  trackedCameras: new Map<string, TrackedCamera>(),
  rates: [] as { t: number; rate: number }[], // of frame sets
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

export function takePosition(sample: Position): void {
  let target = store.targets.get(sample.target);
  if (!target) {
    target = { name: sample.target, latest: sample, heard: 0, history: [] };
    store.targets.set(sample.target, target);
  }
  const last = target.history.at(-1);
  if (last && sample.t <= last.t) {
    if (sample.t > last.t - 1) return; // again, or out of order
    target.history = []; // another service, another clock
  }
  target.latest = sample;
  target.heard = performance.now();
  const [x, y, z] = sample.position;
  target.history.push({
    t: sample.t,
    state: sample.state,
    p: x === null || y === null || z === null ? null : [x, y, z],
    sigma: largestSigma(sample.covariance),
    speed: length(sample.velocity),
    latency: sample.latency,
    ess: sample.ess,
    share: sample.particles > 0 ? sample.ess / sample.particles : 0,
  });
  const from = sample.t - historySeconds;
  let old = 0;
  while (old < target.history.length && target.history[old].t < from) old++;
  if (old > 60) target.history.splice(0, old);
}

export function takeCameraPose(sample: CameraPose): void {
  let camera = store.trackedCameras.get(sample.camera);
  if (!camera) {
    camera = { latest: sample, heard: 0, trail: [] };
    store.trackedCameras.set(sample.camera, camera);
  }
  if (camera.trail.length && sample.t < camera.trail.at(-1)!.t) camera.trail = [];
  camera.latest = sample;
  camera.heard = performance.now();
  const [x, y, z] = sample.position;
  camera.trail.push({ t: sample.t, p: x === null || y === null || z === null ? null : [x, y, z] });
  if (camera.trail.length > 900) camera.trail.splice(0, 300);
}

export function takeStatus(status: Status): void {
  // Of several services the one that spoke last counts; its targets are the ones that there are.
  if (store.status && store.status.pid !== status.pid) store.rates = [];
  store.status = status;
  store.statusHeard = performance.now();
  store.rates.push({ t: status.heard, rate: status.set_rate_hz });
  while (store.rates.length && store.rates[0].t < status.heard - historySeconds) store.rates.shift();
  for (const name of store.targets.keys()) if (!status.targets.includes(name)) store.targets.delete(name);
}

export function isServing(): boolean {
  return store.connected && store.status !== null && performance.now() - store.statusHeard < 4000;
}

export function forget(): void {
  store.targets.clear();
  store.trackedCameras.clear();
  store.rates = [];
}
