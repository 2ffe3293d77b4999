// Plots over the last 10 seconds to 10 minutes, drawn by uPlot: all with the same time axis, and one cursor.
import uPlot from "uplot";
import { likeBefore, lineColorOf, variable } from "./color";
import { canSeek, recordedAt, seekTo } from "./playback";
import { save } from "./save";
import { historySeconds, indexAt, isServing, secondsOfSilence, store, tracks, type Rates, type Sample, type ViewSample } from "./store";
import { label, write } from "./text";
import { isHidden, watchVisibility } from "./visibility";

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

const height = 94; // CSS pixels: a row of plots fits into the dock
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
  chart: Chart;
  now: HTMLElement;
  colors: string[]; // of the series
  written: string; // what `now` is made of
}
const drawn: Drawn[] = [];
const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const parent = $("plots");

const line = (dash: number[]) =>
  `<svg width="26" height="8" aria-hidden="true"><line x1="0" y1="4" x2="26" y2="4" stroke="var(--stroke, currentcolor)" stroke-width="1.8" stroke-dasharray="${dash.join(" ")}"/></svg>`;
function entry(name: string, color: string, dash: number[], text = name): HTMLElement {
  const span = document.createElement("span");
  span.innerHTML = line(dash);
  span.style.setProperty("--stroke", color);
  span.append(` ${text}`);
  span.title = name;
  return span;
}
const resolve = (color: string) => (color.startsWith("var(") ? variable(color.slice(4, -1)) : color);

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

// Until the user chooses, the span grows with the data.
const spans = [10, 20, 30, 60, 120, 300, historySeconds]; // s
const longestUnasked = 30;
let chosen = 0; // s; 0: not chosen
let span = spans[0];
function fitSpan(end: number): void {
  let wanted = chosen;
  if (!wanted) {
    let oldest = end;
    for (const track of tracks()) oldest = Math.min(oldest, track.history[0]?.t ?? end);
    wanted = Math.min(end - oldest, longestUnasked);
  }
  span = spans.find((seconds) => wanted <= seconds) ?? historySeconds;
}
// Rounded to pixels.
export const plotPeriod = () => Math.min(1000, (1000 * span) / 400);
export const plotSpan = () => span;
export const isPaused = () => paused !== null;

// ---- Charts: x is the time in seconds after the end, from -span to 0.
const font = "12px system-ui, sans-serif";
const ago = (s: number) => (s >= 60 ? `−${+(s / 60).toFixed(1)} min` : `−${s} s`);
const end = () => (paused ? "end" : "now");
const axis: uPlot.Axis = { stroke: () => variable("--muted"), font, ticks: { show: false }, grid: { stroke: () => variable("--line"), width: 1 } };
const times: uPlot.Axis = {
  ...axis,
  size: 20,
  gap: 4,
  space: 52,
  grid: { show: false },
  incrs: [1, 2, 5, 10, 20, 60, 120, 300, historySeconds],
  values: (_, all) => all.map((s) => (s ? ago(-s) : end())),
};
const left = 46; // CSS pixels, of the values' axis
const right = 12;

interface Contents {
  series: uPlot.Series[];
  y: uPlot.Scale;
  values: uPlot.Axis;
  onDraw?: (u: uPlot) => void;
}

class Chart {
  u?: uPlot;
  private key = "";

  constructor(readonly box: HTMLElement) {
    box.addEventListener("pointermove", (event) => this.u && pointAt(-this.u.posToVal(event.clientX - this.u.over.getBoundingClientRect().left, "x")));
    box.addEventListener("pointerleave", () => pointAt(null));
    box.addEventListener("click", () => {
      const at = cursor === null || paused ? NaN : recordedAt(cursor - silence());
      if (canSeek() && at >= 0) seekTo(at);
    });
  }

  // Built anew for each key.
  draw(key: string, height: number, data: uPlot.AlignedData, options: () => Contents): void {
    const width = this.box.clientWidth;
    if (width < 100) return; // not laid out yet
    key += end(); // uPlot keeps the labels of an axis while its range is the same
    if (key !== this.key) {
      this.key = key;
      this.u?.destroy();
      const { series, y, values, onDraw } = options();
      this.u = new uPlot(
        {
          width,
          height,
          padding: [6, right, 0, values.show === false ? 18 : 0], // half a time fits
          series: [{}, ...series],
          scales: { x: { time: false, range: () => [-span, 0] }, y },
          axes: [times, { ...axis, size: left, ...values }],
          legend: { show: false },
          cursor: { y: false, points: { show: false } },
          hooks: { draw: onDraw ? [onDraw] : [] },
        },
        data,
        this.box,
      );
    } else {
      if (this.u!.width !== width || this.u!.height !== height) this.u!.setSize({ width, height });
      this.u!.setData(data);
    }
    this.point();
  }

  // Where the cursor is.
  point(): void {
    this.u?.setCursor({ left: cursor === null ? -10 : this.u.valToPos(-cursor, "x"), top: 0 });
  }
}

for (const plot of plots) {
  const figure = document.createElement("figure");
  figure.className = "plot";
  figure.innerHTML = `<figcaption><b></b> <span class="now"></span></figcaption><div class="chart" role="img" style="height: ${height}px"></div>`;
  figure.querySelector("b")!.textContent = plot.title + (plot.unit ? `, ${plot.unit}` : "");
  figure.querySelector("b")!.title = plot.means;
  if (plot.title === "Position")
    figure.querySelector("figcaption")!.insertAdjacentHTML(
      "beforeend",
      `<span class="key">${["x", "y", "z"].map((axis, i) => `${line(dashes[i])} ${axis}`).join(" ")}</span>`,
    );
  parent.append(figure);
  drawn.push({ plot, figure, chart: new Chart(figure.querySelector(".chart")!), now: figure.querySelector(".now")!, colors: [], written: "" });
  watchVisibility(figure, () => changed());
}

// One table of the series, which have times of their own; those of the same samples follow each other.
const gap = 2.5; // s without a sample: the line breaks
function tableOf(all: Series[], end: number): uPlot.AlignedData {
  const tables = new Map<Timed[], [number[], ...(number | null)[][]]>();
  for (const { samples, value } of all) {
    const first = !tables.has(samples);
    if (first) tables.set(samples, [[]]);
    const [x, ...columns] = tables.get(samples)!;
    const column: (number | null)[] = [];
    let last = Infinity;
    const to = indexAt(samples, end + 1e-6);
    for (let i = Math.max(0, indexAt(samples, end - span) - 1); i < to; i++) {
      const { t } = samples[i];
      const v = value(samples[i]);
      if (t - last >= gap) {
        if (first) x.push(last + gap / 2 - end);
        column.push(null);
      }
      if (first) x.push(t - end);
      column.push(Number.isFinite(v) ? v : null);
      last = t;
    }
    tables.set(samples, [x, ...columns, column]);
  }
  return tables.size ? uPlot.join([...tables.values()]) : [[]];
}

function drawPlot(drawn: Drawn, end: number): void {
  const { plot, chart } = drawn;
  const all = plot.series();
  drawn.colors = all.map((s) => resolve(s.color));
  chart.draw(all.map((s) => `${s.name} ${s.dash}`).join("\n") || "none", height, tableOf(all, endOf(plot, end)), () => ({
    series: all.map(({ dash }, i) => ({ width: 1.8, dash, stroke: () => drawn.colors[i], points: { show: false } })),
    y: {
      range: (_, least, most) => {
        let [low, high] = least === null || most === null ? [0, plot.least ?? 1] : [plot.zero ? 0 : least, most];
        const short = Math.max(0, (plot.least ?? 0) - (high - low));
        if (!plot.zero) low -= short / 2;
        high += plot.zero ? short : short / 2;
        const pad = (high - low) * 0.06;
        return [plot.zero ? low : low - pad, high + pad];
      },
    },
    values: { space: 22, values: (_, all) => all.map((v) => String(+v.toPrecision(6))) },
  }));
}

const states = new Chart($("states"));
const names = $("states-names");
let listed = "";
function drawStates(end: number): void {
  const targets = tracks();
  const rows = Math.max(1, targets.length) * 22;
  const list = targets.map((target) => `${target.name}\n${dashOf(target)}\n${resolve(colorOfTrack(target))}`).join("\n");
  if (list !== listed) {
    listed = list;
    names.replaceChildren(...targets.map((target) => entry(target.name, resolve(colorOfTrack(target)), dashOf(target))));
    document.documentElement.style.setProperty("--states", `${rows + 22}px`); // the dock shows them, and a row of plots
  }
  states.draw("states", rows + 22, [[-span, 0]], () => ({ series: [], y: {}, values: { show: false }, onDraw: drawRows }));
  label(states.box, `States over time. Now: ${targets.map((t) => `${t.name} ${t.history.at(-1)?.state ?? "unknown"}`).join(", ") || "no target"}`);
}

function drawRows({ ctx: g, bbox, valToPos }: uPlot): void {
  const last = shownEnd;
  const px = uPlot.pxRatio;
  g.save();
  g.font = `${12 * px}px system-ui, sans-serif`;
  g.textBaseline = "middle";
  g.textAlign = "left";
  const x = (t: number) => Math.max(bbox.left, valToPos(t - last, "x", true));
  tracks().forEach(({ history: samples }, row) => {
    const top = bbox.top + row * 22 * px;
    const to = indexAt(samples, last + 1e-6);
    for (let i = indexAt(samples, last - span); i < to; ) {
      const follows = (k: number) => k + 1 < to && samples[k + 1].t - samples[k].t < pause;
      let k = i;
      while (follows(k) && samples[k + 1].state === samples[i].state) k++;
      const start = x(samples[i].t);
      const width = Math.max(px, x(samples[follows(k) ? k + 1 : k].t) - start);
      const text = samples[i].state;
      g.fillStyle = variable(stateColors[text]);
      g.fillRect(start, top, width, 16 * px);
      g.fillStyle = variable("--on-state");
      if (width > g.measureText(text).width + 8 * px) g.fillText(text, start + 4 * px, top + 8.5 * px);
      i = k + 1;
    }
  });
  g.restore();
}

let shownEnd = 0;
// Of the plots only those in view, unless all are asked for.
export function drawPlots(all = false): void {
  shownEnd = endTime();
  if (Number.isFinite(shownEnd)) fitSpan(shownEnd);
  else shownEnd = 0;
  for (const { plot, figure } of drawn)
    figure.hidden = plot.of === "camera" ? store.trackedCameras.size === 0 : plot.of === "target" && store.targets.size === 0 && store.trackedCameras.size > 0;
  drawStates(shownEnd);
  for (const d of drawn) if (!d.figure.hidden && (all || !isHidden(d.figure))) drawPlot(d, shownEnd);
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
  let isChanged = false;
  const isPast = cursor !== null || paused !== null;
  for (const d of drawn) {
    const { plot, chart, now } = d;
    const isSilent = !isPast && (plot.isStatus ? !isServing() : quiet > 2);
    const isPosition = plot.title === "Position";
    const all = plot.series();
    const valueOf = (s: Series) => {
      const v = isSilent ? NaN : valueAt(s, endOf(plot, end));
      return Number.isFinite(v) ? v.toFixed(Math.abs(v) < 10 ? (isPosition && isPast ? 3 : 2) : 1) : "–";
    };
    const texts = all.map((s) => `${s.name} ${valueOf(s)}`);
    const silent = isSilent && all.length ? (quiet > 2 ? `no samples for ${Math.floor(quiet)} s` : "no samples") : "";
    label(chart.box, `${plot.title} over the last ${span} seconds, ${cursor !== null ? `${cursor.toFixed(1)} s before the end` : "now"}: ${isSilent ? "no samples" : texts.join(", ") || "nothing"}`);
    const written = [isPast, silent, ...texts, ...all.map((s) => s.color)].join();
    if (written === d.written) continue;
    d.written = written;
    isChanged = true;
    // One entry for a target's three coordinates.
    const shown = isPosition ? (isPast ? all.filter((_, i) => i % 3 === 0) : []) : all;
    const entries = shown.map((s, i) => {
      const values = isPosition ? (isPast ? all.slice(3 * i, 3 * i + 3).map(valueOf).join(" ") : "") : valueOf(s);
      // Targets are named once, next to their states; cameras are not.
      return entry(s.name, resolve(s.color), isPosition ? [] : (s.dash ?? []), plot.perTrack ? values : `${s.name} ${values}`);
    });
    now.replaceChildren(...(isSilent ? [silent] : entries));
  }
  write($("plot-cursor"), cursor === null ? "" : `at −${cursor.toFixed(2)} s${inRecording(cursor)}`);
  // As high as a row of plots with these texts, unless the user has chosen a height. It stays while nothing comes.
  if (!isChanged || (quiet > 2 && rowHeight)) return;
  const row = `${Math.max(...drawn.slice(0, 4).map((d) => d.figure.offsetHeight))}px`;
  if (row !== rowHeight && row !== "0px") document.documentElement.style.setProperty("--row", (rowHeight = row));
}

// The cursor's time in the recording that is replayed; a click goes there.
function inRecording(secondsBefore: number): string {
  const at = paused ? NaN : recordedAt(secondsBefore - silence());
  return Number.isFinite(at) && at >= 0 ? `, ${at.toFixed(2)} s in the recording${canSeek() ? ": click to go there" : ""}` : "";
}

// ---- The cursor: under the pointer, or moved with the arrow keys.
function pointAt(seconds: number | null): void {
  cursor = seconds === null ? null : Math.min(span, Math.max(0, seconds));
  for (const chart of [states, ...drawn.map((d) => d.chart)]) chart.point();
  updatePlotTexts();
}
parent.addEventListener("keydown", (event) => {
  const moves: Record<string, number> = { ArrowLeft: span / 100, ArrowRight: -span / 100 };
  if (event.key === "Escape" && cursor !== null) pointAt(null);
  else if (moves[event.key]) pointAt((cursor ?? 0) + moves[event.key] * (event.shiftKey ? 10 : 1));
  else return;
  event.preventDefault();
});
parent.addEventListener("blur", () => pointAt(null));

const spanChoice = $<HTMLSelectElement>("plot-span");
spanChoice.addEventListener("change", () => {
  chosen = Number(spanChoice.value);
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
// The columns of huetrack log and of huetrackd replay --tracks; a tracked camera's are others, so they are another file.
const csvHeads = {
  target: "target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence",
  camera: `camera,t,x,y,z,qx,qy,qz,qw,${[1, 2, 3, 4, 5, 6].flatMap((i) => [1, 2, 3, 4, 5, 6].filter((j) => j >= i).map((j) => `c${i}${j}`)).join()},state,features_in_view,features_matched,confidence`,
};

function csvOf(isCamera: boolean): string {
  const end = endTime();
  const number = (v: number | null) => (v === null || !Number.isFinite(v) ? "nan" : String(v));
  const rows = tracks()
    .filter((track) => track.isCamera === isCamera)
    .flatMap(({ name, history }) =>
      history
        .slice(indexAt(history, end - span), indexAt(history, end + 1e-6))
        .map((s) => [name, s.t.toFixed(9), ...s.columns.map(number), s.state, ...s.counts.map(number)].join()),
    );
  return rows.length ? [isCamera ? csvHeads.camera : csvHeads.target, ...rows].join("\n") + "\n" : "";
}

$("plot-csv").addEventListener("click", () => {
  for (const [text, file] of [[csvOf(false), "huetrack.csv"], [csvOf(true), "huetrack_camera.csv"]])
    if (text) save(new Blob([text], { type: "text/csv" }), file);
});
$("plot-png").addEventListener("click", async () => {
  drawPlots(true);
  await null; // uPlot draws at the end of this task
  const charts = [
    { title: `State of ${tracks().map((t) => t.name).join(", ")}`, chart: states },
    ...drawn.filter((d) => !d.figure.hidden).map(({ figure, chart }) => ({ title: figure.querySelector("b")!.textContent!, chart })),
  ];
  const shown = charts.flatMap(({ title, chart }) => (chart.u ? [{ title, canvas: chart.u.ctx.canvas }] : []));
  const scale = devicePixelRatio;
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
