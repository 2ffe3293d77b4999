// Plots over the last 10 seconds to 10 minutes: one canvas each, all with the same time axis, and one cursor.
import { likeBefore, lineColorOf, variable } from "./color";
import { canSeek, recordedAt, seekTo } from "./playback";
import { save } from "./save";
import { historySeconds, indexAt, isServing, secondsOfSilence, store, tracks, type Rates, type Sample, type ViewSample } from "./store";
import { label } from "./text";

type Timed = { t: number };
interface Series<S extends Timed = Timed> {
  name: string;
  color: string;
  dash?: number[];
  samples: S[]; // ascending times
  value: (sample: S) => number; // NaN breaks the line
}

interface Plot {
  title: string;
  unit: string;
  means: string; // the title's tooltip
  series: () => Series[];
  zero?: boolean; // the axis starts at 0
  least?: number; // the axis covers at least so much
  of?: "target" | "camera"; // only where there is one
  perTrack?: boolean; // its lines have the tracks' colours
  isStatus?: boolean; // of the status, with the bridge's clock
}

const height = 92; // CSS pixels: a row of plots fits into the dock
const stateColors = { tracking: "--good", coasting: "--warn", searching: "--info", lost: "--bad" } as const;

const colorOfTrack = (track: { name: string; isCamera: boolean }) => (track.isCamera ? "var(--accent)" : lineColorOf(track.name));

// Distinguish targets of the same colour.
const sameHueDashes = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
const dashOf = (track: { name: string; isCamera: boolean }) => (track.isCamera ? [] : sameHueDashes[Math.min(likeBefore(track.name), sameHueDashes.length - 1)]);
const dashes = [[], [7, 4], [2, 3]]; // x, y, z

function series<S extends Timed = Sample>(name: string, color: string, dash: number[], samples: S[], value: (s: S) => number): Series {
  return { name, color, dash, samples, value } as unknown as Series;
}

function perTrack(value: (s: Sample) => number): () => Series[] {
  return () =>
    tracks().map((t) => series(t.name, colorOfTrack(t), dashOf(t), t.history, value));
}

// Cameras: four colours that are distinguishable with red-green blindness, then dashes.
function perCamera<S extends Timed>(what: (camera: string) => [S[], (sample: S) => number]): Series[] {
  return (store.status?.cameras ?? []).map(({ name }, i) => series(name, `var(--camera-${i % 4})`, dashes[Math.floor(i / 4) % dashes.length], ...what(name)));
}

const plots: Plot[] = [
  {
    title: "Position",
    perTrack: true,
    unit: "m",
    means: "In the calibration's world frame",
    least: 0.2,
    series: () =>
      tracks().flatMap((t) => ["x", "y", "z"].map((axis, i) => series(`${t.name} ${axis}`, colorOfTrack(t), dashes[i], t.history, (s) => (s.p ? s.p[i] : NaN)))),
  },
  { title: "Uncertainty, 1σ", perTrack: true, unit: "mm", means: "Standard deviation along the largest axis, the most uncertain direction", zero: true, least: 5, series: perTrack((s) => s.sigma * 1000) },
  { title: "Speed", perTrack: true, unit: "m/s", means: "Speed of each object", zero: true, least: 0.5, series: perTrack((s) => s.speed) },
  { title: "Latency", perTrack: true, unit: "ms", means: "From the capture of the picture to the publication of the position", zero: true, least: 5, series: perTrack((s) => s.latency * 1000) },
  { title: "Latency from arrival", perTrack: true, unit: "ms", means: "From the arrival of the last byte of the pictures to the publication of the position: decoding and tracking", zero: true, least: 5, series: perTrack((s) => s.processing * 1000) },
  {
    title: "Residual of each camera",
    unit: "px",
    means: "Distance in a camera's picture between the object and its position from all cameras: a camera that stands out was knocked, or is late",
    zero: true,
    least: 1,
    of: "target",
    series: () => perCamera((camera) => [store.views.get(camera) ?? [], (s: ViewSample) => s.residual]),
  },
  { title: "Features matched", perTrack: true, unit: "", means: "Points of the map that were found in the picture", zero: true, least: 10, of: "camera", series: perTrack((s) => s.features) },
  {
    title: "Frames of each camera, and sets",
    unit: "/s",
    means: "A frame set has at most one frame of each camera, captured at one moment; it gives one position",
    zero: true,
    least: 10,
    isStatus: true,
    series: () => [
      ...perCamera((camera) => [store.rates, (r: Rates) => r.cameras.get(camera) ?? NaN]),
      series("sets", "var(--ink)", [2, 3], store.rates, (r) => r.rate),
    ],
  },
];

interface Drawn {
  plot: Plot;
  figure: HTMLElement;
  canvas: HTMLCanvasElement;
  now: HTMLElement;
}
const drawn: Drawn[] = [];
const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const parent = $("plots");
const states = $<HTMLCanvasElement>("states");

const line = (dash: number[]) =>
  `<svg width="26" height="8" aria-hidden="true"><line x1="0" y1="4" x2="26" y2="4" stroke="currentcolor" stroke-width="1.8" stroke-dasharray="${dash.join(" ")}"/></svg>`;

for (const plot of plots) {
  const figure = document.createElement("figure");
  figure.className = "plot";
  figure.innerHTML = `<figcaption><b></b> <span class="now"></span></figcaption><canvas role="img"></canvas>`;
  figure.querySelector("b")!.textContent = plot.title + (plot.unit ? `, ${plot.unit}` : "");
  figure.querySelector("b")!.title = plot.means;
  if (plot.title === "Position")
    figure.querySelector("figcaption")!.insertAdjacentHTML(
      "beforeend",
      `<span class="key">${["x", "y", "z"].map((axis, i) => `${line(dashes[i])} ${axis}`).join(" ")}</span>`,
    );
  parent.append(figure);
  const canvas = figure.querySelector("canvas")!;
  canvas.style.height = `${height}px`;
  drawn.push({ plot, figure, canvas, now: figure.querySelector(".now")! });
}

function prepare(canvas: HTMLCanvasElement): [CanvasRenderingContext2D, number, number] {
  const w = canvas.clientWidth;
  const h = canvas.clientHeight;
  const r = Math.min(devicePixelRatio, 2);
  if (canvas.width !== Math.round(w * r) || canvas.height !== Math.round(h * r)) {
    canvas.width = Math.round(w * r);
    canvas.height = Math.round(h * r);
  }
  const g = canvas.getContext("2d")!;
  g.setTransform(r, 0, 0, r, 0, 0);
  g.clearRect(0, 0, w, h);
  return [g, w, h];
}

const resolve = (color: string) => (color.startsWith("var(") ? variable(color.slice(4, -1)) : color);

function step(range: number, count: number): number {
  const raw = range / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return ([1, 2, 5].find((m) => m * power >= raw) ?? 10) * power;
}

// ---- The shown time: up to now, or up to when Pause was pressed.
let paused: { end: number; rates: number } | null = null;
let cursor: number | null = null; // seconds before the end
// Called when the user changes something.
let changed = () => {};
export function onPlotsChanged(listener: () => void): void {
  changed = listener;
}

// The end of the time axis on the samples' clock; it advances while there are no samples.
const pause = 1; // s that may lie between two samples
function endTime(): number {
  if (paused) return paused.end;
  let t = -Infinity;
  for (const track of tracks()) t = Math.max(t, track.history.at(-1)?.t ?? -Infinity);
  return t + silence();
}
// Rates have the bridge's clock.
function endOfRates(): number {
  if (paused) return paused.rates;
  const sinceStatus = (performance.now() - store.statusHeard) / 1000;
  return (store.rates.at(-1)?.t ?? 0) + (sinceStatus > 2 ? sinceStatus : 0);
}
const endOf = (plot: Plot, end: number) => (plot.isStatus ? endOfRates() : end);
// Seconds since the last sample; 0 while they arrive.
function silence(): number {
  const since = secondsOfSilence();
  return Number.isFinite(since) && since > pause ? since : 0;
}

// Spans and steps of the axis. Until the user chooses, the span grows with the data.
const ticks = [
  [10, 2],
  [20, 5],
  [30, 10],
  [60, 10],
  [120, 20],
  [300, 60],
  [historySeconds, 120],
];
const longestUnasked = 30;
let chosen = 0; // s; 0: not chosen
let [span, tick] = ticks[0];
function fitSpan(end: number): void {
  let wanted = chosen;
  if (!wanted) {
    let oldest = end;
    for (const track of tracks()) oldest = Math.min(oldest, track.history[0]?.t ?? end);
    wanted = Math.min(end - oldest, longestUnasked);
  }
  [span, tick] = ticks.find(([seconds]) => wanted <= seconds) ?? ticks[ticks.length - 1];
}
// Rounded to pixels.
export const plotPeriod = () => Math.min(1000, (1000 * span) / 400);
export const plotSpan = () => span;
export const isPaused = () => paused !== null;

const left = 46;
const right = 10;

function drawPlot({ plot, canvas }: Drawn, end: number): void {
  const [g, w, h] = prepare(canvas);
  const bottom = 18;
  const all = plot.series();
  const own = endOf(plot, end);
  const begin = own - span;
  const parts = all.map((s) => [indexAt(s.samples, begin), indexAt(s.samples, own + 1e-6)]);
  let low = Infinity;
  let high = -Infinity;
  all.forEach((s, k) => {
    for (let i = parts[k][0]; i < parts[k][1]; i++) {
      const v = s.value(s.samples[i]);
      if (v < low) low = v;
      if (v > high) high = v;
    }
  });
  if (low > high) [low, high] = [0, plot.least ?? 1];
  if (plot.zero) low = 0;
  const short = (plot.least ?? 0) - (high - low);
  if (short > 0) plot.zero ? (high += short) : ((low -= short / 2), (high += short / 2));
  const pad = (high - low) * 0.06;
  high += pad;
  if (!plot.zero) low -= pad;
  const x = (t: number) => left + ((t - begin) / span) * (w - left - right);
  const y = (v: number) => h - bottom - ((v - low) / (high - low)) * (h - bottom - 6);
  const muted = variable("--muted");
  g.font = "12px system-ui, sans-serif";
  g.strokeStyle = variable("--line");
  g.fillStyle = muted;
  g.lineWidth = 1;
  g.textAlign = "right";
  g.textBaseline = "middle";
  const dy = step(high - low, h / 30);
  for (let v = Math.ceil(low / dy) * dy; v <= high; v += dy) {
    g.beginPath();
    g.moveTo(left, y(v));
    g.lineTo(w - right, y(v));
    g.stroke();
    g.fillText(Math.abs(v) < dy / 1e6 ? "0" : String(+v.toPrecision(6)), left - 6, y(v));
  }
  timeAxis(g, w, h);
  g.save();
  g.beginPath();
  g.rect(left, 0, w - left - right, h - bottom + 1);
  g.clip();
  all.forEach((s, k) => {
    g.strokeStyle = resolve(s.color);
    g.lineWidth = 1.8;
    g.setLineDash(s.dash ?? []);
    g.beginPath();
    trace(g, s, Math.max(0, parts[k][0] - 1), parts[k][1], x, y);
    g.stroke();
  });
  g.setLineDash([]);
  if (cursor !== null) drawCursor(g, x(own - cursor), 0, h - bottom);
  g.restore();
}

// Of many samples on one pixel only the first, least, greatest and last are visible.
function trace(g: CanvasRenderingContext2D, s: Series, from: number, to: number, x: (t: number) => number, y: (v: number) => number): void {
  const gap = 2.5; // s without a sample: the line breaks
  let open = false;
  let last = -Infinity;
  let column = NaN;
  let [least, most, latest] = [0, 0, 0];
  const close = () => {
    if (least !== most) {
      g.lineTo(column, y(least));
      g.lineTo(column, y(most));
    }
    g.lineTo(column, y(latest));
  };
  for (let i = from; i < to; i++) {
    const { t } = s.samples[i];
    const v = s.value(s.samples[i]);
    const isThere = Number.isFinite(v);
    if (open && (!isThere || t - last >= gap)) {
      close();
      open = false;
    }
    if (!isThere) continue;
    const at = Math.round(2 * x(t)) / 2;
    if (open && at === column) {
      least = Math.min(least, v);
      most = Math.max(most, v);
    } else {
      if (open) close();
      if (open) g.lineTo(at, y(v));
      else g.moveTo(at, y(v));
      column = at;
      least = most = v;
    }
    latest = v;
    last = t;
    open = true;
  }
  if (open) close();
}

function drawCursor(g: CanvasRenderingContext2D, x: number, top: number, bottom: number): void {
  g.strokeStyle = variable("--ink");
  g.lineWidth = 1;
  g.beginPath();
  g.moveTo(x, top);
  g.lineTo(x, bottom);
  g.stroke();
}

const ago = (s: number) => (s >= 120 ? `−${+(s / 60).toFixed(1)} min` : `−${s} s`);

function timeAxis(g: CanvasRenderingContext2D, w: number, h: number, from = left): void {
  g.textBaseline = "alphabetic";
  // A narrow plot has fewer of them, and none on its neighbour.
  const room = 1.5 * g.measureText(ago(span)).width + 8; // the oldest begins at its tick, the others are centred
  const wide = Math.max(1, (tick / span) * (w - from - right));
  const each = tick * Math.ceil(room / wide);
  for (let s = 0; s <= span; s += each) {
    const at = from + (1 - s / span) * (w - from - right);
    g.textAlign = s === 0 ? "right" : s === span ? "left" : "center";
    g.fillText(s === 0 ? (paused ? "paused" : "now") : ago(s), at, h - 4);
  }
}

let statesFrom = left; // where the strip begins
function drawStates(end: number): void {
  const targets = tracks();
  const tall = `${Math.max(1, targets.length) * 22 + 20}px`;
  if (states.style.height !== tall) {
    states.style.height = tall;
    document.documentElement.style.setProperty("--states", tall); // the dock shows them, and a row of plots
  }
  const [g, w, h] = prepare(states);
  const begin = end - span;
  g.font = "12px system-ui, sans-serif";
  const widest = Math.max(0, ...targets.map((t) => g.measureText(t.name).width));
  const from = (statesFrom = Math.min(Math.max(left, widest + 28), w / 3)); // of the strip; a name that is still wider is cut
  const x = (t: number) => from + ((t - begin) / span) * (w - from - right);
  const cut = (name: string) => {
    let text = name;
    while (text.length > 1 && g.measureText(text).width > from - 24) text = `${text.replace("…", "").slice(0, -1)}…`;
    return text;
  };
  targets.forEach((target, row) => {
    const y = row * 22 + 4;
    g.fillStyle = variable("--muted");
    g.textAlign = "right";
    g.textBaseline = "middle";
    g.fillText(cut(target.name), from - 24, y + 8);
    g.strokeStyle = resolve(colorOfTrack(target));
    g.lineWidth = 1.8;
    g.setLineDash(dashOf(target));
    g.beginPath();
    g.moveTo(from - 20, y + 8);
    g.lineTo(from - 4, y + 8);
    g.stroke();
    g.setLineDash([]);
    const samples = target.history;
    const to = indexAt(samples, end + 1e-6);
    for (let i = indexAt(samples, begin); i < to; ) {
      let k = i;
      while (k + 1 < to && samples[k + 1].state === samples[i].state && samples[k + 1].t - samples[k].t < 1) k++;
      const start = x(samples[i].t);
      const until = k + 1 < to && samples[k + 1].t - samples[k].t < 1 ? x(samples[k + 1].t) : x(samples[k].t) + 1;
      g.fillStyle = variable(stateColors[samples[i].state]);
      g.fillRect(start, y, Math.max(1, until - start), 16);
      const text = samples[i].state;
      if (until - start > g.measureText(text).width + 8) {
        g.fillStyle = variable("--on-state");
        g.textAlign = "left";
        g.fillText(text, start + 4, y + 8.5);
      }
      i = k + 1;
    }
  });
  g.fillStyle = variable("--muted");
  timeAxis(g, w, h, from);
  if (cursor !== null) drawCursor(g, x(end - cursor), 0, h - 18);
  label(states, `States over time. Now: ${targets.map((t) => `${t.name} ${t.history.at(-1)?.state ?? "unknown"}`).join(", ") || "no target"}`);
}

export function drawPlots(): void {
  const end = endTime();
  if (Number.isFinite(end)) fitSpan(end);
  for (const { plot, figure } of drawn)
    figure.hidden = plot.of === "camera" ? store.trackedCameras.size === 0 : plot.of === "target" && store.targets.size === 0 && store.trackedCameras.size > 0;
  drawStates(Number.isFinite(end) ? end : 0);
  for (const d of drawn) drawPlot(d, Number.isFinite(end) ? end : 0);
}

// The value nearest to the cursor, or the newest; NaN: there is none.
function valueAt(s: Series, end: number): number {
  if (cursor === null && !paused) return s.samples.length ? s.value(s.samples[s.samples.length - 1]) : NaN;
  const t = end - (cursor ?? 0);
  const i = indexAt(s.samples, t);
  const near = [s.samples[i - 1], s.samples[i]].filter((one) => one && Math.abs(one.t - t) < 1).sort((a, b) => Math.abs(a.t - t) - Math.abs(b.t - t));
  return near.length ? s.value(near[0]) : NaN;
}

let rowHeight = "";
// Once a second, for screen readers; and at the cursor.
export function updatePlotTexts(): void {
  const quiet = silence();
  const end = endTime();
  for (const { plot, canvas, now } of drawn) {
    const isPast = cursor !== null || paused !== null;
    const isSilent = !isPast && (plot.isStatus ? !isServing() : quiet > 2);
    const isPosition = plot.title === "Position";
    const all = plot.series();
    const valueOf = (s: Series) => {
      const v = isSilent ? NaN : valueAt(s, endOf(plot, end));
      return Number.isFinite(v) ? v.toFixed(Math.abs(v) < 10 ? (isPosition && isPast ? 3 : 2) : 1) : "–";
    };
    // One entry for a target's three coordinates.
    const shown = isPosition ? (isPast ? all.filter((_, i) => i % 3 === 0) : []) : all;
    now.replaceChildren(
      ...shown.map((s, i) => {
        const entry = document.createElement("span");
        entry.innerHTML = line(isPosition ? [] : (s.dash ?? []));
        (entry.firstElementChild as SVGElement).style.color = resolve(s.color);
        const values = isPosition ? (isPast ? ` ${all.slice(3 * i, 3 * i + 3).map(valueOf).join(" ")}` : "") : ` ${valueOf(s)}`;
        // Targets are named once, beside their states; cameras are not.
        entry.append(plot.perTrack ? values : ` ${s.name}${values}`);
        entry.title = s.name;
        return entry;
      }),
      ...(isSilent && all.length ? [quiet > 2 ? `no samples for ${Math.floor(quiet)} s` : "no samples"] : []),
    );
    const texts = all.map((s) => `${s.name} ${valueOf(s)}`);
    label(canvas, `${plot.title} over the last ${span} seconds, ${cursor !== null ? `${cursor.toFixed(1)} s before the end` : "now"}: ${isSilent ? "no samples" : texts.join(", ") || "nothing"}`);
  }
  // As high as a row of plots with these texts, unless the user has chosen a height.
  const row = `${Math.max(...drawn.slice(0, 4).map((d) => d.figure.offsetHeight))}px`;
  if (row !== rowHeight && row !== "0px") document.documentElement.style.setProperty("--row", (rowHeight = row));
  $("plot-cursor").textContent = cursor === null ? "" : `at −${cursor.toFixed(2)} s${inRecording(cursor)}`;
}

// The cursor's time in the recording that is replayed; a click goes there.
function inRecording(secondsBefore: number): string {
  const at = paused ? NaN : recordedAt(secondsBefore - silence());
  return Number.isFinite(at) && at >= 0 ? `, ${at.toFixed(2)} s in the recording${canSeek() ? ": click to go there" : ""}` : "";
}

// ---- The cursor: under the pointer, or moved with the arrow keys.
function pointAt(seconds: number | null): void {
  cursor = seconds === null ? null : Math.min(span, Math.max(0, seconds));
  updatePlotTexts();
  changed();
}
function follow(canvas: HTMLCanvasElement, from: () => number): void {
  canvas.addEventListener("pointermove", (event) => {
    const r = canvas.getBoundingClientRect();
    pointAt(span * (1 - (event.clientX - r.left - from()) / (r.width - from() - right)));
  });
  canvas.addEventListener("pointerleave", () => pointAt(null));
  canvas.addEventListener("click", () => {
    const at = cursor === null || paused ? NaN : recordedAt(cursor - silence());
    if (canSeek() && at >= 0) seekTo(at);
  });
}
for (const { canvas } of drawn) follow(canvas, () => left);
follow(states, () => statesFrom);
parent.addEventListener("keydown", (event) => {
  const moves: Record<string, number> = { ArrowLeft: span / 100, ArrowRight: -span / 100 };
  if (event.key === "Escape" && cursor !== null) pointAt(null);
  else if (moves[event.key]) pointAt((cursor ?? 0) + moves[event.key] * (event.shiftKey ? 10 : 1));
  else return;
  event.preventDefault();
});
parent.addEventListener("blur", () => pointAt(null));

const spans = $<HTMLSelectElement>("plot-span");
spans.addEventListener("change", () => {
  chosen = Number(spans.value);
  changed();
});
$("plot-pause").addEventListener("click", () => {
  const end = endTime();
  paused = paused || !Number.isFinite(end) ? null : { end, rates: endOfRates() };
  $("plot-pause").textContent = paused ? "Go on" : "Pause";
  $("plot-pause").setAttribute("aria-pressed", String(paused !== null));
  updatePlotTexts();
  changed();
});

// ---- Export
$("plot-csv").addEventListener("click", () => {
  const end = endTime();
  const rows = ["name,t,state,x,y,z,sigma_m,speed_m_s,latency_s,residual_px"];
  const number = (v: number, digits: number) => (Number.isFinite(v) ? v.toFixed(digits) : "");
  const name = (text: string) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  for (const track of tracks())
    for (const s of track.history.slice(indexAt(track.history, end - span), indexAt(track.history, end + 1e-6)))
      rows.push([name(track.name), s.t.toFixed(6), s.state, ...[0, 1, 2].map((i) => number(s.p?.[i] ?? NaN, 6)), number(s.sigma, 6), number(s.speed, 4), number(s.latency, 6), number(s.residual, 3)].join());
  save(new Blob([rows.join("\n") + "\n"], { type: "text/csv" }), "huetrack.csv");
});
$("plot-png").addEventListener("click", () => {
  drawPlots();
  const shown = [{ title: "State", canvas: states }, ...drawn.filter((d) => !d.figure.hidden).map((d) => ({ title: d.figure.querySelector("b")!.textContent!, canvas: d.canvas }))];
  const scale = Math.min(devicePixelRatio, 2);
  const title = 22 * scale;
  const width = Math.max(...shown.map((s) => s.canvas.width));
  const sheet = Object.assign(document.createElement("canvas"), { width, height: shown.reduce((sum, s) => sum + s.canvas.height + title, 0) });
  const g = sheet.getContext("2d")!;
  g.fillStyle = variable("--panel");
  g.fillRect(0, 0, sheet.width, sheet.height);
  g.fillStyle = variable("--ink");
  g.font = `600 ${13 * scale}px system-ui, sans-serif`;
  let top = 0;
  for (const { title: text, canvas } of shown) {
    g.fillText(text, 6 * scale, top + 16 * scale);
    g.drawImage(canvas, 0, top + title);
    top += title + canvas.height;
  }
  sheet.toBlob((blob) => blob && save(blob, "huetrack-plots.png"));
});
