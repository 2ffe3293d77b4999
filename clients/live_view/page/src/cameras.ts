// The cameras' pictures, with what the tracker thinks drawn over them.
import { colorOf } from "./color";
import type { Color, Preview } from "./messages";
import { store } from "./store";

interface View {
  card: HTMLElement;
  canvas: HTMLCanvasElement;
  health: HTMLElement;
  note: HTMLElement;
  image: ImageBitmap | null;
  preview: Preview | null;
  decoding: boolean;
  next: Preview | null;
}

const views = new Map<string, View>();
const grid = document.getElementById("cameras")!;

export async function bitmapOf(base64: string): Promise<ImageBitmap> {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  return createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
}

function viewOf(camera: string): View {
  const old = views.get(camera);
  if (old) return old;
  const card = document.createElement("figure");
  card.className = "camera";
  card.innerHTML = `<figcaption><b></b><span class="chip"></span></figcaption><canvas role="img"></canvas><p class="note" hidden></p>`;
  card.querySelector("b")!.textContent = camera;
  const view: View = {
    card,
    canvas: card.querySelector("canvas")!,
    health: card.querySelector(".chip")!,
    note: card.querySelector(".note")!,
    image: null,
    preview: null,
    decoding: false,
    next: null,
  };
  view.canvas.setAttribute("aria-label", `Camera ${camera}: no picture yet`);
  views.set(camera, view);
  grid.append(card);
  document.getElementById("no-cameras")!.hidden = true;
  return view;
}

// Pictures that come while one is being decoded replace each other: a slow page shows fewer, not later ones.
export async function showPreview(preview: Preview): Promise<void> {
  const view = viewOf(preview.camera);
  view.next = preview;
  if (view.decoding) return;
  view.decoding = true;
  try {
    while (view.next) {
      const current: Preview = view.next;
      view.next = null;
      const image = await bitmapOf(current.jpeg);
      view.image?.close();
      view.image = image;
      view.preview = current;
      draw(view);
    }
  } finally {
    view.decoding = false;
  }
}

// While a colour is taught: what would match in each camera's moving picture, too.
export interface LiveMask {
  color: Color;
  ignored: number[][]; // boxes, pixels of the camera's image
}
let liveMask: Map<string, LiveMask> | null = null;
export function showLiveMasks(masks: Map<string, LiveMask> | null): void {
  if (!masks && !liveMask) return;
  liveMask = masks;
  redrawCameras();
}

const sketch = document.createElement("canvas");
// HSI as the tracker computes it (service/object_tracking/color_model.cpp), of the preview's pixels.
function maskOf(image: ImageBitmap, { color, ignored }: LiveMask, imageWidth: number): HTMLCanvasElement {
  const [w, h] = [image.width, image.height];
  if (sketch.width !== w || sketch.height !== h) [sketch.width, sketch.height] = [w, h];
  const g = sketch.getContext("2d", { willReadFrequently: true })!;
  g.drawImage(image, 0, 0);
  const pixels = g.getImageData(0, 0, w, h);
  const d = pixels.data;
  const [from, to] = color.hue_deg;
  for (let i = 0; i < d.length; i += 4) {
    const [r, g8, b] = [d[i], d[i + 1], d[i + 2]];
    const intensity = (r + g8 + b) / 3;
    const least = Math.min(r, g8, b);
    const saturation = intensity > 0 ? 1 - least / intensity : 0;
    let on = saturation >= color.saturation[0] && saturation <= color.saturation[1];
    on &&= intensity / 255 >= color.intensity[0] && intensity / 255 <= color.intensity[1] && Math.max(r, g8, b) > least;
    if (on) {
      const hue = ((Math.atan2((Math.sqrt(3) / 2) * (g8 - b), r - (g8 + b) / 2) * 180) / Math.PI + 360) % 360;
      on = from <= to ? hue >= from && hue <= to : hue >= from || hue <= to;
    }
    [d[i], d[i + 1], d[i + 2], d[i + 3]] = on ? [255, 0, 220, 255] : [0, 0, 0, 120];
  }
  g.putImageData(pixels, 0, 0);
  const s = w / imageWidth;
  for (const [u0, v0, u1, v1] of ignored) {
    g.clearRect(u0 * s, v0 * s, (u1 - u0 + 1) * s, (v1 - v0 + 1) * s);
    g.fillStyle = "rgb(0 0 0 / 0.47)";
    g.fillRect(u0 * s, v0 * s, (u1 - u0 + 1) * s, (v1 - v0 + 1) * s);
  }
  return sketch;
}

// Everything in pixels of the camera's image; the canvas is scaled so that lines stay thin on any size.
function draw(view: View): void {
  const { preview, image, canvas } = view;
  if (!preview || !image) return;
  const width = Math.max(320, Math.round(canvas.clientWidth * devicePixelRatio)) || preview.size[0];
  const height = Math.round((width * preview.image[1]) / preview.image[0]);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const g = canvas.getContext("2d")!;
  g.drawImage(image, 0, 0, width, height);
  const s = width / preview.image[0];
  const looked = liveMask?.get(preview.camera);
  if (looked) {
    g.globalAlpha = 0.75;
    g.imageSmoothingEnabled = false;
    g.drawImage(maskOf(image, looked, preview.image[0]), 0, 0, width, height);
    g.imageSmoothingEnabled = true;
    g.globalAlpha = 1;
  }
  const line = Math.max(1.2, 1.4 * devicePixelRatio);
  const at = (u: number, v: number): [number, number] => [(u + 0.5) * s, (v + 0.5) * s];
  const seen: string[] = [];
  const labels: Box[] = [];
  for (const target of preview.targets) {
    const color = colorOf(target.target);
    if (target.state === "left_out") {
      const [u0, v0, u1, v1] = target.particles as number[];
      const [x0, y0] = at(u0 - 0.5, v0 - 0.5), [x1, y1] = at(u1 + 0.5, v1 + 0.5);
      for (const [width, style] of [[line * 2.4, "rgb(0 0 0 / 0.55)"], [line, color]] as const) {
        g.lineWidth = width;
        g.strokeStyle = style;
        g.setLineDash([2 * line, 4 * line]);
        g.strokeRect(x0, y0, x1 - x0, y1 - y0);
      }
      g.setLineDash([]);
      label(g, `${target.target}: never moves, left out`, (x0 + x1) / 2, y0 - 2 * line, color, labels);
      seen.push(`of ${target.target}'s colour and left out, as it never moves: from ${u0}, ${v0} to ${u1}, ${v1}`);
      continue;
    }
    // With a dark rim: of the object's own colour they would not be seen on it.
    const dot = 2.6 * devicePixelRatio;
    for (const [size, style] of [[dot + 1.6 * devicePixelRatio, "rgb(0 0 0 / 0.55)"], [dot, color]] as const) {
      g.fillStyle = style;
      for (let i = 0; i + 1 < target.particles.length; i += 2) {
        const [x, y] = at(target.particles[i]!, target.particles[i + 1]!);
        g.fillRect(x - size / 2, y - size / 2, size, size);
      }
    }
    if (target.px[0] === null || target.px[1] === null) continue;
    const [x, y] = at(target.px[0], target.px[1]);
    const ring = (width: number, style: string, dashed: boolean) => {
      g.lineWidth = width;
      g.strokeStyle = style;
      g.setLineDash(dashed ? [4 * line, 3 * line] : []);
      g.beginPath();
      g.arc(x, y, Math.max(3, (target.radius ?? 0) * s), 0, 2 * Math.PI);
      g.stroke();
      const [a, b, angle] = target.ellipse;
      if (a !== null && b !== null && angle !== null) {
        g.beginPath();
        g.ellipse(x, y, Math.min(a * s, 4 * canvas.width), Math.min(b * s, 4 * canvas.width), angle, 0, 2 * Math.PI);
        g.stroke();
      }
      g.setLineDash([]);
      const arm = 5 * line;
      g.beginPath();
      g.moveTo(x - arm, y);
      g.lineTo(x + arm, y);
      g.moveTo(x, y - arm);
      g.lineTo(x, y + arm);
      g.stroke();
    };
    const coasts = target.state === "coasting";
    ring(line * 2.6, "rgb(0 0 0 / 0.65)", coasts);
    ring(line, "white", coasts);
    label(g, `${target.target}${coasts ? " (predicted)" : ""}`, x, y - Math.max(3, (target.radius ?? 0) * s) - 6 * line, color, labels);
    seen.push(`${target.target} ${target.state} at ${Math.round(target.px[0])}, ${Math.round(target.px[1])}`);
  }
  canvas.setAttribute("aria-label", `Camera ${preview.camera}: ${seen.join("; ") || "no target in view"}`);
}

type Box = [number, number, number, number];

// taken: where there are labels already; it is put above those that it would cover.
export function label(g: CanvasRenderingContext2D, text: string, x: number, y: number, color: string, taken: Box[] = []): void {
  const size = 12 * devicePixelRatio;
  g.font = `600 ${size}px system-ui, sans-serif`;
  g.textAlign = "center";
  g.textBaseline = "bottom";
  const width = g.measureText(text).width;
  const left = Math.min(Math.max(x, width / 2 + 6), g.canvas.width - width / 2 - 6);
  let bottom = Math.max(y, size + 6);
  const box = (): Box => [left - width / 2 - 6, bottom - size - 4, left + width / 2 + 6, bottom + 6];
  const covers = ([x0, y0, x1, y1]: Box) => taken.some((t) => x0 < t[2] && t[0] < x1 && y0 < t[3] && t[1] < y1);
  for (let tries = 0; tries < 4 && covers(box()); tries++) bottom -= size + 10;
  if (bottom < size + 6) {
    bottom = Math.max(y, size + 6);
    for (let tries = 0; tries < 4 && covers(box()); tries++) bottom += size + 10;
  }
  taken.push(box());
  g.fillStyle = "rgb(0 0 0 / 0.6)";
  g.beginPath();
  g.roundRect(left - width / 2 - 5, bottom - size - 3, width + 10, size + 6, 4);
  g.fill();
  g.fillStyle = color;
  g.fillRect(left - width / 2 - 5, bottom + 3, width + 10, 2);
  g.fillStyle = "white";
  g.fillText(text, left, bottom);
}

const healthWords = {
  delivering: "delivering",
  waiting: "waiting for its first frame",
  stalled: "stalled",
  absent: "absent",
  ended: "recording ended",
  unknown: "unknown",
};

// Once a second: health, and cameras that are gone.
export function updateCameras(serving: boolean): void {
  const status = store.status;
  for (const camera of status?.cameras ?? []) {
    const view = viewOf(camera.name);
    const isHeld = serving && status!.mode === "held";
    const health = serving ? camera.health : "unknown";
    view.health.textContent = isHeld
      ? "held at its first frame"
      : health === "delivering"
        ? `${camera.rate_hz.toFixed(1)} Hz`
        : healthWords[health] ?? health;
    view.health.dataset.health = isHeld ? "held" : health;
    const troubles = isHeld ? [] : [camera.message];
    if (camera.dropped) troubles.push(`${camera.dropped} of ${camera.frames + camera.dropped} frames dropped`);
    if (camera.corrupted) troubles.push(`${camera.corrupted} damaged`);
    const text = troubles.filter(Boolean).join("; ");
    view.note.textContent = text;
    view.note.hidden = !text;
    view.card.classList.toggle("stale", !serving || (health !== "delivering" && !isHeld));
  }
  for (const [name, view] of views)
    if (!status?.cameras.some((c) => c.name === name)) view.card.classList.toggle("stale", !serving);
  // Three across leave no hole; so do five and more. Fewer stand beside the scene.
  const count = views.size;
  document.getElementById("main")!.dataset.cameras = count === 3 || count > 4 ? "row" : "beside";
  grid.style.setProperty("--columns", String(count === 3 || count === 5 || count === 6 ? 3 : count > 4 ? 4 : Math.min(2, count)));
  const order = status?.cameras.map((c) => views.get(c.name)!.card) ?? [];
  if (order.some((card, i) => grid.children[i] !== card)) grid.append(...order);
  for (const [name, view] of views) {
    if (status && !status.cameras.some((c) => c.name === name)) {
      view.card.remove();
      views.delete(name);
    }
  }
}

// Another service's pictures say nothing of this one's.
export function forgetPictures(): void {
  for (const view of views.values()) view.card.remove();
  views.clear();
  document.getElementById("no-cameras")!.hidden = false;
}

export function redrawCameras(): void {
  for (const view of views.values()) draw(view);
}
