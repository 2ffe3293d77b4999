// Plots over the last half minute: one canvas each, all with the same time axis.
import { likeBefore, lineColorOf, variable } from "./color";
import { historySeconds, isServing, secondsOfSilence, store, tracks, type Sample } from "./store";

interface Series {
  name: string;
  color: string;
  dash?: number[];
  points: [number, number][]; // t, y; NaN breaks the line
}

interface Plot {
  title: string;
  unit: string;
  height: number;
  series: () => Series[];
  zero?: boolean; // the axis starts at 0
  least?: number; // the axis covers at least so much
  of?: "target" | "camera"; // only where there is one
}

const stateColors = { tracking: "--good", coasting: "--warn", searching: "--info", lost: "--bad" } as const;

const colorOfTrack = (track: { name: string; isCamera: boolean }) => (track.isCamera ? "var(--accent)" : lineColorOf(track.name));

// Targets of one colour are told apart by these.
const sameHueDashes = [[], [7, 4], [2, 3], [9, 3, 2, 3]];

function perTrack(value: (s: Sample) => number): () => Series[] {
  return () =>
    tracks().map((t) => ({
      name: t.name,
      color: colorOfTrack(t),
      dash: t.isCamera ? [] : sameHueDashes[Math.min(likeBefore(t.name), sameHueDashes.length - 1)],
      points: t.history.map((s) => [s.t, value(s)] as [number, number]),
    }));
}

const dashes = [[], [7, 4], [2, 3]];
const plots: Plot[] = [
  {
    title: "Position",
    unit: "m",
    height: 150,
    least: 0.2,
    series: () =>
      tracks().flatMap((t) =>
        ["x", "y", "z"].map((axis, i) => ({
          name: `${t.name} ${axis}`,
          color: colorOfTrack(t),
          dash: dashes[i],
          points: t.history.map((s) => [s.t, s.p ? s.p[i] : NaN] as [number, number]),
        })),
      ),
  },
  { title: "Uncertainty (1σ, largest axis)", unit: "mm", height: 150, zero: true, least: 5, series: perTrack((s) => s.sigma * 1000) },
  { title: "Speed", unit: "m/s", height: 150, zero: true, least: 0.5, series: perTrack((s) => s.speed) },
  { title: "Latency, capture to bus", unit: "ms", height: 150, zero: true, least: 5, series: perTrack((s) => s.latency * 1000) },
  { title: "Effective particles", unit: "", height: 150, zero: true, least: 50, of: "target", series: perTrack((s) => s.ess) },
  { title: "Features matched", unit: "", height: 150, zero: true, least: 10, of: "camera", series: perTrack((s) => s.features) },
  {
    title: "Frame sets tracked",
    unit: "/s",
    height: 150,
    zero: true,
    least: 10,
    series: () => [{ name: "sets", color: "var(--accent)", points: store.rates.map((r) => [r.t, r.rate] as [number, number]) }],
  },
];

interface Drawn {
  plot: Plot;
  figure: HTMLElement;
  canvas: HTMLCanvasElement;
  now: HTMLElement;
}
const drawn: Drawn[] = [];
const parent = document.getElementById("plots")!;
const states = document.getElementById("states") as HTMLCanvasElement;

const line = (dash: number[]) =>
  `<svg width="26" height="8" aria-hidden="true"><line x1="0" y1="4" x2="26" y2="4" stroke="currentcolor" stroke-width="1.8" stroke-dasharray="${dash.join(" ")}"/></svg>`;

for (const plot of plots) {
  const figure = document.createElement("figure");
  figure.className = "plot";
  figure.innerHTML = `<figcaption><b></b> <span class="now"></span></figcaption><canvas role="img"></canvas>`;
  figure.querySelector("b")!.textContent = plot.title + (plot.unit ? `, ${plot.unit}` : "");
  if (plot.title === "Position")
    figure.querySelector("figcaption")!.insertAdjacentHTML(
      "beforeend",
      `<span class="key">${["x", "y", "z"].map((axis, i) => `${line(dashes[i])} ${axis}`).join(" ")}</span>`,
    );
  parent.append(figure);
  const canvas = figure.querySelector("canvas")!;
  canvas.style.height = `${plot.height}px`;
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

// Where the time axis ends, on the samples' clock: while nothing comes it goes on, and what was is left behind.
const pause = 1; // s that may lie between two samples
function endTime(): number {
  let t = -Infinity;
  for (const track of tracks()) t = Math.max(t, track.history.at(-1)?.t ?? -Infinity);
  return t + silence();
}
// Seconds since the last sample of all; 0 while they come.
function silence(): number {
  const since = secondsOfSilence();
  return Number.isFinite(since) && since > pause ? since : 0;
}

// As long as there is something to show, in whole steps of the axis: a service that has just begun does not draw into a corner.
const ticks = [
  [10, 2],
  [20, 5],
  [historySeconds, 10],
];
let span = ticks[0][0];
let tick = ticks[0][1];
function fitSpan(end: number): void {
  let oldest = end;
  for (const track of tracks()) oldest = Math.min(oldest, track.history[0]?.t ?? end);
  [span, tick] = ticks.find(([seconds]) => end - oldest <= seconds) ?? ticks[ticks.length - 1];
}

const left = 46;
const right = 10;

function drawPlot({ plot, canvas }: Drawn, end: number): void {
  const [g, w, h] = prepare(canvas);
  const bottom = 18;
  const series = plot.series();
  const isRate = plot.title.startsWith("Frame sets");
  const sinceStatus = (performance.now() - store.statusHeard) / 1000;
  const own = isRate ? (store.rates.at(-1)?.t ?? 0) + (sinceStatus > 2 ? sinceStatus : 0) : end;
  const begin = own - span;
  let low = Infinity;
  let high = -Infinity;
  for (const s of series)
    for (const [t, y] of s.points)
      if (t >= begin && Number.isFinite(y)) {
        low = Math.min(low, y);
        high = Math.max(high, y);
      }
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
  const dy = step(high - low, h / 36);
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
  for (const s of series) {
    g.strokeStyle = resolve(s.color);
    g.lineWidth = 1.8;
    g.setLineDash(s.dash ?? []);
    g.beginPath();
    let open = false;
    let last = -Infinity;
    for (const [t, v] of s.points) {
      if (t < begin - 1) continue;
      if (!Number.isFinite(v)) {
        open = false;
        continue;
      }
      if (open && t - last < 2.5) g.lineTo(x(t), y(v));
      else g.moveTo(x(t), y(v));
      open = true;
      last = t;
    }
    g.stroke();
  }
  g.restore();
}

function timeAxis(g: CanvasRenderingContext2D, w: number, h: number, from = left): void {
  g.textBaseline = "alphabetic";
  for (let s = 0; s <= span; s += tick) {
    const at = from + (1 - s / span) * (w - from - right);
    g.textAlign = s === 0 ? "right" : s === span ? "left" : "center";
    g.fillText(s === 0 ? "now" : `−${s} s`, at, h - 4);
  }
}

function drawStates(end: number): void {
  const targets = tracks();
  states.style.height = `${Math.max(1, targets.length) * 22 + 20}px`;
  const [g, w, h] = prepare(states);
  const begin = end - span;
  g.font = "12px system-ui, sans-serif";
  const widest = Math.max(0, ...targets.map((t) => g.measureText(t.name).width));
  const from = Math.min(Math.max(left, widest + 8), w / 3); // of the strip; a name that is still wider is cut
  const x = (t: number) => from + ((t - begin) / span) * (w - from - right);
  const cut = (name: string) => {
    let text = name;
    while (text.length > 1 && g.measureText(text).width > from - 6) text = `${text.replace("…", "").slice(0, -1)}…`;
    return text;
  };
  targets.forEach((target, row) => {
    const y = row * 22 + 4;
    g.fillStyle = variable("--muted");
    g.textAlign = "right";
    g.textBaseline = "middle";
    g.fillText(cut(target.name), from - 6, y + 8);
    const samples = target.history.filter((s) => s.t >= begin);
    for (let i = 0; i < samples.length; ) {
      let k = i;
      while (k + 1 < samples.length && samples[k + 1].state === samples[i].state && samples[k + 1].t - samples[k].t < 1) k++;
      const start = x(samples[i].t);
      const to = k + 1 < samples.length && samples[k + 1].t - samples[k].t < 1 ? x(samples[k + 1].t) : x(samples[k].t) + 1;
      g.fillStyle = variable(stateColors[samples[i].state]);
      g.fillRect(start, y, Math.max(1, to - start), 16);
      const text = samples[i].state;
      if (to - start > g.measureText(text).width + 8) {
        g.fillStyle = variable("--on-state");
        g.textAlign = "left";
        g.fillText(text, start + 4, y + 8.5);
      }
      i = k + 1;
    }
  });
  g.fillStyle = variable("--muted");
  timeAxis(g, w, h, from);
  states.setAttribute("aria-label", `States over time. Now: ${targets.map((t) => `${t.name} ${t.history.at(-1)?.state ?? "unknown"}`).join(", ") || "no target"}`);
}

export function drawPlots(): void {
  const end = endTime();
  if (Number.isFinite(end)) fitSpan(end);
  for (const { plot, figure } of drawn)
    figure.hidden = plot.of === "camera" ? store.trackedCameras.size === 0 : plot.of === "target" && store.targets.size === 0 && store.trackedCameras.size > 0;
  drawStates(Number.isFinite(end) ? end : 0);
  for (const d of drawn) drawPlot(d, Number.isFinite(end) ? end : 0);
}

// Once a second, for who does not see the lines.
export function updatePlotTexts(): void {
  const quiet = silence();
  for (const { plot, canvas, now } of drawn) {
    const isSilent = plot.title.startsWith("Frame sets") ? !isServing() : quiet > 2;
    const isPosition = plot.title === "Position";
    const series = plot.series();
    const valueOf = (s: Series) => {
      const v = s.points.at(-1)?.[1];
      return isSilent || v === undefined || !Number.isFinite(v) ? "–" : v.toFixed(Math.abs(v) < 10 ? 2 : 1);
    };
    // Of a target's three coordinates one line stands for its colour; which is which is said beside.
    const shown = isPosition ? series.filter((_, i) => i % 3 === 0) : series;
    now.replaceChildren(
      ...shown.map((s) => {
        const entry = document.createElement("span");
        entry.innerHTML = line(isPosition ? [] : (s.dash ?? []));
        (entry.firstElementChild as SVGElement).style.color = resolve(s.color);
        entry.append(isPosition ? ` ${s.name.slice(0, -2)}` : ` ${s.name} ${valueOf(s)}`);
        return entry;
      }),
      ...(isSilent && series.length ? [quiet > 2 ? `nothing for ${Math.floor(quiet)} s` : "nothing comes"] : []),
    );
    const texts = series.map((s) => `${s.name} ${valueOf(s)}`);
    canvas.setAttribute("aria-label", `${plot.title} over the last ${historySeconds} seconds, now: ${isSilent ? "nothing comes" : texts.join(", ") || "nothing"}`);
  }
}
