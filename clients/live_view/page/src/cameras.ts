// The cameras' pictures with the tracker's estimates drawn over them.
import { colorOf, ringColorOf } from "./color";
import { Labels, type Labelled } from "./labels";
import type { CameraStatus, Color, Preview } from "./messages";
import { save } from "./save";
import { remember, setting } from "./settings";
import { forPictures, openTool } from "./shell";
import { write } from "./text";
import { isHidden, watchVisibility } from "./visibility";
import { isConnecting, store, targetOf } from "./store";

// What a tool draws on a camera's picture, or in its place. Pixels are those of the camera's image.
export interface Placed {
  g: CanvasRenderingContext2D;
  at: (u: number, v: number) => [number, number]; // the middle of a pixel on the canvas
  scale: number; // canvas pixels to one of the image
  line: number; // width of a thin line
  draw: (source: CanvasImageSource & { width: number }, alpha: number) => void; // a picture of the whole image
}
export interface Layer {
  frozen?: { image: ImageBitmap; size: [number, number] }; // in place of the live picture
  paint?: (on: Placed) => void;
  point?: (pixel: [number, number]) => void; // a click; without it a click enlarges
  drags?: () => boolean; // a drag is the tool's, not a move of a magnified picture
  drag?: (from: [number, number], to: [number, number], isEnd: boolean) => void;
  key?: (event: KeyboardEvent) => void;
  label?: string; // for screen readers
}
const layers = new Map<string, Layer>();

interface View {
  camera: string;
  card: HTMLElement;
  canvas: HTMLCanvasElement;
  health: HTMLElement;
  note: HTMLElement;
  awaited: HTMLElement;
  button: HTMLButtonElement;
  image: ImageBitmap | null;
  preview: Preview | null;
  decoding: boolean;
  next: Preview | null;
  isNew: boolean; // the picture is not drawn yet
  zoom: number; // >= 1
  middle: [number, number]; // of what is shown, pixels of the camera's image
  pointers: Map<number, [number, number]>; // that are down on it, CSS pixels
  isDragged: boolean; // since the first of them went down
  pressed: [number, number] | null; // pixel where a drag of the tool began
}

const views = new Map<string, View>();
const grid = document.getElementById("cameras")!;
const stage = document.getElementById("stage")!;
let large = ""; // the camera that is shown large; empty: none
const mostZoom = 16;

export async function bitmapOf(base64: string): Promise<ImageBitmap> {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length); // Uint8Array.from() would call a function for each
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
}

function viewOf(camera: string): View {
  const old = views.get(camera);
  if (old) return old;
  const card = document.createElement("figure");
  card.className = "camera";
  card.innerHTML =
    `<figcaption><b></b><span class="chip"></span><button type="button" class="keep"><svg viewBox="0 0 24 24" aria-hidden="true"><path d="M12 4v11M7 11l5 5 5-5M5 20h14"/></svg></button><button type="button" class="enlarge" aria-pressed="false"></button></figcaption>` +
    `<canvas role="img"></canvas><p class="awaited"></p><p class="note" hidden></p>`;
  card.querySelector("b")!.textContent = camera;
  const view: View = {
    camera,
    card,
    canvas: card.querySelector("canvas")!,
    health: card.querySelector(".chip")!,
    note: card.querySelector(".note")!,
    awaited: card.querySelector(".awaited")!,
    button: card.querySelector(".enlarge")!,
    image: null,
    preview: null,
    decoding: false,
    next: null,
    isNew: false,
    zoom: 1,
    middle: [0, 0],
    pointers: new Map(),
    isDragged: false,
    pressed: null,
  };
  view.button.id = `enlarge-${camera}`;
  view.button.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="M9 4H4v5M15 20h5v-5M4 4l6 6M20 20l-6-6"/></svg>`;
  view.button.setAttribute("aria-label", `Show ${camera} large`);
  view.button.title = "Large. The wheel or two fingers zoom, dragging moves";
  const keep = card.querySelector(".keep")!;
  keep.id = `keep-${camera}`;
  keep.setAttribute("aria-label", `Save the picture of ${camera}`);
  keep.setAttribute("title", "Save this picture");
  keep.addEventListener("click", () => view.canvas.toBlob((blob) => blob && save(blob, `${camera}-${view.preview?.set ?? 0}.png`)));
  view.canvas.setAttribute("aria-label", `Camera ${camera}: no picture yet`);
  view.canvas.dataset.camera = camera;
  shape(view, store.scene?.cameras.find((c) => c.name === camera)?.size ?? [4, 3]);
  attach(view);
  resizes.observe(view.canvas);
  watchVisibility(view.canvas, () => (view.next && !view.decoding ? void decode(view) : draw(view)));
  views.set(camera, view);
  grid.append(card);
  document.getElementById("no-cameras")!.hidden = true;
  return view;
}

// Redraws after a change of size, by the window or by other cameras.
const resizes = new ResizeObserver((entries) => {
  for (const { target } of entries) for (const view of views.values()) if (view.canvas === target && !isHidden(target)) draw(view);
});

// As wide as it is tall, in truth.
function shape(view: View, [w, h]: [number, number]): void {
  const ratio = String(w / Math.max(1, h));
  if (view.card.style.getPropertyValue("--ratio") !== ratio) view.card.style.setProperty("--ratio", ratio);
}

// ---- One camera large, and a part of it larger
function enlarge(camera: string): void {
  large = camera;
  for (const view of views.values()) {
    const isLarge = view.camera === large;
    view.card.classList.toggle("large", isLarge);
    view.button.setAttribute("aria-pressed", String(isLarge));
    view.button.setAttribute("aria-label", `Show ${view.camera} ${isLarge ? "small again" : "large"}`);
    if (!isLarge) view.zoom = 1;
  }
  // The plots give their room to it.
  document.body.toggleAttribute("data-large", large !== "");
  arrange();
  redrawCameras();
}

const sizeOf = (view: View): [number, number] => layers.get(view.camera)?.frozen?.size ?? view.preview?.image ?? [view.canvas.width, view.canvas.height];

// The pixel of the camera's image under a place of the window.
function pixelAt(view: View, x: number, y: number): [number, number] {
  const r = view.canvas.getBoundingClientRect();
  const size = sizeOf(view);
  const corner = cornerOf(view);
  return [0, 1].map((i) => {
    const share = ([x, y][i] - [r.left, r.top][i]) / [r.width, r.height][i];
    return Math.min(size[i] - 1, Math.max(0, Math.round(corner[i] + (share * size[i]) / view.zoom - 0.5)));
  }) as [number, number];
}

// Draws a tool's layer on a camera's picture; null: none any more.
export function setLayer(camera: string, layer: Layer | null): void {
  const view = views.get(camera);
  if (layer) layers.set(camera, layer);
  else layers.delete(camera);
  if (!view) return;
  view.card.classList.toggle("frozen", !!layer?.point || !!layer?.drags);
  view.canvas.setAttribute("role", layer?.key ? "application" : "img");
  if (layer?.key) view.canvas.tabIndex = 0;
  else view.canvas.removeAttribute("tabindex");
  if (layer?.label) view.canvas.setAttribute("aria-label", layer.label);
  draw(view);
}
export const clearLayers = () => [...layers.keys()].forEach((camera) => setLayer(camera, null));
export function redrawLayer(camera: string): void {
  const view = views.get(camera);
  if (view) draw(view);
}
// Marks a camera among the others; empty: none.
export function choose(camera: string): void {
  for (const view of views.values()) view.card.classList.toggle("chosen", view.camera === camera);
}
export const hasFocus = (camera: string) => document.activeElement === views.get(camera)?.canvas;

// The left and upper edge of what is shown, pixels of the camera's image.
function cornerOf(view: View): [number, number] {
  return sizeOf(view).map((size, i) => Math.min(Math.max(view.middle[i] - size / (2 * view.zoom), 0), size - size / view.zoom)) as [number, number];
}

// The place under (x, y), CSS pixels of the window, stays where it is.
function zoomAt(view: View, x: number, y: number, factor: number): void {
  const r = view.canvas.getBoundingClientRect();
  const size = sizeOf(view);
  const share = [(x - r.left) / r.width, (y - r.top) / r.height];
  const corner = cornerOf(view);
  const zoom = Math.min(mostZoom, Math.max(1, view.zoom * factor));
  view.middle = [0, 1].map((i) => corner[i] + (share[i] * size[i]) / view.zoom + ((0.5 - share[i]) * size[i]) / zoom) as [number, number];
  view.zoom = zoom;
  settle(view);
}

function move(view: View, dx: number, dy: number): void {
  const r = view.canvas.getBoundingClientRect();
  const size = sizeOf(view);
  const corner = cornerOf(view);
  view.middle = [0, 1].map((i) => corner[i] + size[i] / (2 * view.zoom) - ([dx, dy][i] / [r.width, r.height][i]) * (size[i] / view.zoom)) as [number, number];
  settle(view);
}

function settle(view: View): void {
  const corner = cornerOf(view);
  view.middle = sizeOf(view).map((size, i) => corner[i] + size / (2 * view.zoom)) as [number, number];
  view.canvas.classList.toggle("zoomed", view.zoom > 1);
  draw(view);
}

function attach(view: View): void {
  const { canvas, pointers } = view;
  const toggle = () => enlarge(large === view.camera ? "" : view.camera);
  view.button.addEventListener("click", toggle);
  canvas.addEventListener("keydown", (event) => layers.get(view.camera)?.key?.(event));
  canvas.addEventListener("blur", () => layers.has(view.camera) && draw(view));
  // The wheel zooms, unless it scrolls through more cameras than fit.
  canvas.addEventListener(
    "wheel",
    (event) => {
      const scrolls = grid.scrollHeight > grid.clientHeight + 1;
      if (scrolls && large !== view.camera && !layers.has(view.camera) && !event.ctrlKey) return;
      event.preventDefault();
      zoomAt(view, event.clientX, event.clientY, Math.exp(-event.deltaY * (event.deltaMode === 1 ? 0.05 : 0.0015)));
    },
    { passive: false },
  );
  canvas.addEventListener("pointerdown", (event) => {
    if (!pointers.size) view.isDragged = false;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    view.pressed = null;
    if (pointers.size > 1 || !layers.get(view.camera)?.drags?.()) return;
    view.pressed = pixelAt(view, event.clientX, event.clientY);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now: [number, number] = [event.clientX, event.clientY];
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const distance = (p: [number, number]) => Math.max(1, Math.hypot(p[0] - other[0], p[1] - other[1]));
      zoomAt(view, (now[0] + other[0]) / 2, (now[1] + other[1]) / 2, distance(now) / distance(before));
      view.isDragged = true;
    } else if (view.pressed) {
      view.isDragged = true;
      layers.get(view.camera)?.drag?.(view.pressed, pixelAt(view, ...now), false);
    } else if (view.zoom > 1) {
      if (!view.isDragged && Math.hypot(now[0] - before[0], now[1] - before[1]) < 4) return; // tremor
      if (!canvas.hasPointerCapture(event.pointerId)) canvas.setPointerCapture(event.pointerId);
      view.isDragged = true;
      move(view, now[0] - before[0], now[1] - before[1]);
    } else if (!view.isDragged) {
      // A swipe is no click; a finger trembles by some pixels.
      view.isDragged = Math.hypot(now[0] - before[0], now[1] - before[1]) > 8;
      if (!view.isDragged) return;
    }
    pointers.set(event.pointerId, now);
  });
  canvas.addEventListener("pointerup", (event) => {
    if (view.pressed) layers.get(view.camera)?.drag?.(view.pressed, pixelAt(view, event.clientX, event.clientY), true);
    view.pressed = null;
  });
  for (const name of ["pointerup", "pointercancel", "pointerleave"] as const)
    canvas.addEventListener(name, (event) => {
      if (name !== "pointerleave" || !canvas.hasPointerCapture(event.pointerId)) pointers.delete(event.pointerId);
    });
  canvas.addEventListener("click", (event) => {
    const layer = layers.get(view.camera);
    if (view.isDragged) {
      view.isDragged = false;
      return;
    }
    if (layer?.point) layer.point(pixelAt(view, event.clientX, event.clientY));
    else if (!layer?.drags?.()) toggle();
  });
  view.button.addEventListener("keydown", (event) => {
    if (large !== view.camera) return;
    const r = canvas.getBoundingClientRect();
    const step = Math.min(r.width, r.height) / 10;
    const moves: Record<string, [number, number]> = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (event.key === "+" || event.key === "=") zoomAt(view, r.left + r.width / 2, r.top + r.height / 2, 1.3);
    else if (event.key === "-") zoomAt(view, r.left + r.width / 2, r.top + r.height / 2, 1 / 1.3);
    else if (event.key === "0") zoomAt(view, 0, 0, 1 / mostZoom);
    else if (moves[event.key]) move(view, ...moves[event.key]);
    else return;
    event.preventDefault();
  });
}
addEventListener("keydown", (event) => {
  if (event.key === "Escape" && large && !event.defaultPrevented) enlarge("");
});

// Pictures that arrive during a decoding replace each other: a slow page shows fewer, not later ones. Invisible ones are decoded
// when they come into view or are requested.
export async function showPreview(preview: Preview): Promise<void> {
  const view = viewOf(preview.camera);
  view.next = preview;
  if (!view.decoding && !isHidden(view.canvas)) await decode(view);
}

// Requested once a second where the brightness of invisible pictures is shown.
export function decodeAwaited(): void {
  for (const view of views.values()) if (view.next && !view.decoding) void decode(view);
}

let newPictureListener = () => {};
export function onNewPicture(listener: () => void): void {
  newPictureListener = listener;
}
export function drawNewPictures(): void {
  for (const view of views.values()) if (view.isNew && !isHidden(view.canvas)) draw(view);
}

async function decode(view: View): Promise<void> {
  view.decoding = true;
  try {
    while (view.next) {
      const current: Preview = view.next;
      view.next = null;
      const image = await bitmapOf(current.jpeg);
      view.image?.close();
      view.image = image;
      view.preview = current;
      view.awaited.hidden = true;
      if (!layers.get(view.camera)?.frozen) shape(view, current.image);
      view.isNew = true;
      newPictureListener();
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

// While a radius is changed: the ring of this target is as much larger.
let changedRing = { target: "", factor: 1 };
export function showRadius(target: string, factor: number): void {
  if (changedRing.target === target && changedRing.factor === factor) return;
  changedRing = { target, factor: Number.isFinite(factor) && factor > 0 ? factor : 1 };
  redrawCameras();
}

// Matching share of a camera's last picture while masks are shown; null: unknown.
const shares = new Map<string, number>();
export const matchingShare = (camera: string): number | null => (liveMask?.has(camera) ? shares.get(camera) ?? null : null);

const sketch = document.createElement("canvas");
// HSI as the tracker computes it (service/color/color_model.cpp), of the preview's pixels.
function maskOf(image: ImageBitmap, { color, ignored }: LiveMask, imageWidth: number): HTMLCanvasElement {
  const [w, h] = [image.width, image.height];
  if (sketch.width !== w || sketch.height !== h) [sketch.width, sketch.height] = [w, h];
  const g = sketch.getContext("2d", { willReadFrequently: true })!;
  g.drawImage(image, 0, 0);
  const pixels = g.getImageData(0, 0, w, h);
  const d = pixels.data;
  const [from, to] = color.hue_deg;
  let matching = 0;
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
    if (on) matching++;
    [d[i], d[i + 1], d[i + 2], d[i + 3]] = on ? [255, 0, 220, 255] : [0, 0, 0, 120];
  }
  shares.set(color.camera, matching / (w * h));
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
  view.isNew = false;
  const layer = layers.get(view.camera);
  if (layer?.frozen) drawFrozen(view, layer, layer.frozen);
  else drawLive(view);
}

// The canvas as large as it is shown, for an image of this size.
function fitted(canvas: HTMLCanvasElement, size: [number, number], otherwise: number): CanvasRenderingContext2D {
  const width = Math.max(160, Math.round(canvas.clientWidth * devicePixelRatio)) || otherwise;
  const height = Math.round((width * size[1]) / size[0]);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  return canvas.getContext("2d")!;
}

function placed(view: View, g: CanvasRenderingContext2D): Placed {
  const size = sizeOf(view);
  const corner = cornerOf(view);
  const scale = (g.canvas.width / size[0]) * view.zoom;
  return {
    g,
    scale,
    line: Math.max(1.2, 1.4 * devicePixelRatio),
    at: (u, v) => [(u + 0.5 - corner[0]) * scale, (v + 0.5 - corner[1]) * scale],
    draw: (source, alpha) => {
      const part = source.width / size[0];
      g.globalAlpha = alpha;
      g.drawImage(source, corner[0] * part, corner[1] * part, (size[0] * part) / view.zoom, (size[1] * part) / view.zoom, 0, 0, g.canvas.width, g.canvas.height);
      g.globalAlpha = 1;
    },
  };
}

function drawFrozen(view: View, layer: Layer, { image, size }: NonNullable<Layer["frozen"]>): void {
  shape(view, size);
  const on = placed(view, fitted(view.canvas, size, image.width));
  on.draw(image, 1);
  layer.paint?.(on);
}

function drawLive(view: View): void {
  const { preview, image, canvas } = view;
  if (!preview || !image) return;
  const g = fitted(canvas, preview.image, preview.size[0]);
  const { width, height } = canvas;
  const on = placed(view, g);
  const { at, scale: s, line } = on;
  on.draw(image, 1);
  const looked = liveMask?.get(preview.camera);
  if (looked) {
    g.imageSmoothingEnabled = false;
    on.draw(maskOf(image, looked, preview.image[0]), 0.75);
    g.imageSmoothingEnabled = true;
  }
  const seen: string[] = [];
  const named: Labelled[] = [];
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
      named.push({ text: `${target.target}: static, ignored`, color, x: (x0 + x1) / 2, y: (y0 + y1) / 2, radius: (y1 - y0) / 2 + 2 * line });
      seen.push(`of ${target.target}'s colour, but static and ignored: from ${u0}, ${v0} to ${u1}, ${v1}`);
      continue;
    }
    // With a dark rim, visible on the object's own colour.
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
    const changed = targetOf(target.target, [changedRing.target]) === changedRing.target ? changedRing.factor : 1;
    const radius = Math.max(3, (target.radius ?? 0) * changed * s);
    const ring = (width: number, style: string, dashed: boolean) => {
      g.lineWidth = width;
      g.strokeStyle = style;
      g.setLineDash(dashed ? [4 * line, 3 * line] : []);
      g.beginPath();
      g.arc(x, y, radius, 0, 2 * Math.PI);
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
    ring(line * 2.8, "rgb(0 0 0 / 0.8)", coasts);
    ring(line * 1.3, ringColorOf(target.target), coasts);
    seen.push(`${target.target} ${target.state} at ${Math.round(target.px[0])}, ${Math.round(target.px[1])}`);
    if (x >= 0 && y >= 0 && x < width && y < height)
      named.push({ text: `${target.target}${coasts ? " (predicted)" : ""}`, color: ringColorOf(target.target), x, y, radius: radius + 2 * line });
  }
  const labels = new Labels(g);
  for (const one of named) labels.keepFree(one);
  for (const one of named) labels.add(one);
  const wanted = preview.targets.find((t) => t.target === magnified && t.state !== "left_out" && t.px[0] !== null && t.px[1] !== null);
  if (wanted) drawMagnifier(g, image, preview, wanted, named);
  const layer = layers.get(view.camera);
  layer?.paint?.(on);
  canvas.setAttribute("aria-label", layer?.label ?? `Camera ${preview.camera}: ${seen.join("; ") || "no target in view"}`);
}

const healthWords = {
  delivering: "delivering",
  waiting: "waiting for its first frame",
  stalled: "stalled",
  absent: "absent",
  ended: "recording ended",
  unknown: "unknown",
};

// Why the rate of a delivering camera is too low; empty: it is not.
export function slowness(camera: CameraStatus): string {
  if (camera.health !== "delivering") return "";
  // The rate is unknown just after the start.
  if (camera.rate_hz < 0.05) return camera.age_s > 1 ? "no frame in the last seconds" : "";
  const cameras = store.status?.cameras ?? [];
  const best = cameras.reduce((a, b) => (b.rate_hz > a.rate_hz ? b : a), camera);
  // Cameras of one rig may be twice as fast as others, not three times.
  return camera.rate_hz < 0.4 * best.rate_hz ? `only ${camera.rate_hz.toFixed(1)} frames a second, where ${best.name} gives ${best.rate_hz.toFixed(1)}` : "";
}

// The mean colour around a pixel of the camera's newest picture, 0 to 255; null: there is none.
export function colorAt(camera: string, [u, v]: [number, number]): [number, number, number] | null {
  const view = views.get(camera);
  if (!view?.image || !view.preview) return null;
  const scale = view.image.width / view.preview.image[0];
  const side = 3; // pixels of the preview
  const patch = Object.assign(document.createElement("canvas"), { width: side, height: side }).getContext("2d", { willReadFrequently: true })!;
  patch.drawImage(view.image, Math.round((u + 0.5) * scale - side / 2), Math.round((v + 0.5) * scale - side / 2), side, side, 0, 0, side, side);
  const { data } = patch.getImageData(0, 0, side, side);
  return [0, 1, 2].map((c) => data.reduce((sum, value, i) => (i % 4 === c ? sum + value : sum), 0) / side ** 2) as [number, number, number];
}

// ---- How bright a picture is: of intensities, shares of the picture.
export interface Light {
  dark: number; // below `least`, the least that a target's pixels have by default
  bright: number; // above `most`
  least: number;
  most: number;
  histogram: number[];
}
const [leastIntensity, mostIntensity] = [0.1, 0.95];
const sample = Object.assign(document.createElement("canvas"), { width: 96, height: 72 });
export function lightOf(camera: string): Light | null {
  const image = views.get(camera)?.image;
  if (!image) return null;
  const g = sample.getContext("2d", { willReadFrequently: true })!;
  g.drawImage(image, 0, 0, sample.width, sample.height);
  const { data } = g.getImageData(0, 0, sample.width, sample.height);
  const histogram = Array<number>(32).fill(0);
  let [dark, bright] = [0, 0];
  for (let i = 0; i < data.length; i += 4) {
    const intensity = (data[i] + data[i + 1] + data[i + 2]) / (3 * 255);
    histogram[Math.min(31, Math.floor(32 * intensity))]++;
    if (intensity < leastIntensity) dark++;
    else if (intensity > mostIntensity) bright++;
  }
  const count = data.length / 4;
  return { dark: dark / count, bright: bright / count, least: leastIntensity, most: mostIntensity, histogram };
}

// ---- The magnifier: what is around the object, in the corner that is farthest from it.
const magnifierShare = 0.38; // of the picture's shorter side
const magnifierRadii = 2.2; // of the object, from its middle to the magnifier's edge
let magnified = setting("magnify", ""); // the target; empty: none
const magnify = document.getElementById("magnify") as HTMLSelectElement;
magnify.addEventListener("change", () => {
  magnified = magnify.value;
  remember("magnify", magnified);
  redrawCameras();
});
function updateMagnifier(): void {
  const names = [...store.targets.keys()];
  if (magnified && !names.includes(magnified) && store.status?.targets.includes(magnified)) names.push(magnified);
  if ([...magnify.options].slice(1).map((o) => o.value).join("\n") === names.join("\n")) return;
  magnify.replaceChildren(new Option("nothing", ""), ...names.map((name) => new Option(name, name)));
  magnify.value = names.includes(magnified) ? magnified : "";
  magnified = magnify.value;
}

// taken: what is drawn at which canvas pixels, the object's own among it.
function drawMagnifier(g: CanvasRenderingContext2D, image: ImageBitmap, preview: Preview, target: Preview["targets"][0], taken: Labelled[]): void {
  const { width, height } = g.canvas;
  const scale = image.width / preview.image[0];
  const reach = Math.max(6, magnifierRadii * (target.radius ?? 0)); // pixels of the camera's image
  const side = magnifierShare * Math.min(width, height);
  const margin = 4 * devicePixelRatio;
  // Of the four corners the one whose nearest object is farthest.
  const corners = [margin, width - side - margin].flatMap((left) => [margin, height - side - margin].map((top) => [left, top]));
  const room = ([left, top]: number[]) => Math.min(Infinity, ...taken.map((one) => Math.hypot(left + side / 2 - one.x, top + side / 2 - one.y) - one.radius));
  const [left, top] = corners.reduce((best, corner) => (room(corner) > room(best) ? corner : best));
  const [u, v] = target.px as [number, number];
  g.fillStyle = "black";
  g.fillRect(left, top, side, side);
  g.imageSmoothingEnabled = false; // shows single pixels
  g.drawImage(image, (u + 0.5 - reach) * scale, (v + 0.5 - reach) * scale, 2 * reach * scale, 2 * reach * scale, left, top, side, side);
  g.imageSmoothingEnabled = true;
  const color = ringColorOf(target.target);
  const [cx, cy] = [left + side / 2, top + side / 2];
  const arm = side / 24;
  for (const [width, style] of [[3, "rgb(0 0 0 / 0.7)"], [1.3, color]] as const) {
    g.lineWidth = width * devicePixelRatio;
    g.strokeStyle = style;
    g.beginPath();
    g.arc(cx, cy, Math.max(2, ((target.radius ?? 0) * side) / (2 * reach)), 0, 2 * Math.PI);
    g.moveTo(cx - arm, cy);
    g.lineTo(cx + arm, cy);
    g.moveTo(cx, cy - arm);
    g.lineTo(cx, cy + arm);
    g.stroke();
    g.strokeRect(left, top, side, side);
  }
}

// Once a second: health, and cameras that are gone.
export function updateCameras(serving: boolean): void {
  const status = store.status;
  updateMagnifier();
  for (const camera of status?.cameras ?? []) {
    const view = viewOf(camera.name);
    const isHeld = serving && status!.mode === "held";
    const health = serving ? camera.health : "unknown";
    const slow = serving && !isHeld ? slowness(camera) : "";
    const state = isHeld
      ? "paused"
      : health === "delivering"
        ? camera.rate_hz > 0 // of the last second, of which there was none yet
          ? `${camera.rate_hz.toFixed(1)} Hz`
          : slow
            ? "no frames"
            : "begins"
        : healthWords[health] ?? health;
    write(view.health, state);
    view.health.dataset.health = isHeld ? "held" : slow ? "stalled" : health;
    // What goes on now; counts since the start are under Health.
    const text = isHeld ? "" : [camera.message, slow].filter(Boolean).join("; ");
    write(view.note, text);
    view.note.hidden = !text;
    view.card.classList.toggle("stale", !serving || (health !== "delivering" && !isHeld));
    if (!view.preview) {
      const size = store.scene?.cameras.find((c) => c.name === camera.name)?.size;
      if (size) shape(view, size);
      const why = !serving
        ? isConnecting() ? "" : "No service sends pictures."
        : health === "delivering" || isHeld
          ? "Waiting for its first picture."
          : `No picture: the camera is ${healthWords[health] ?? health}.`;
      write(view.awaited, why);
    }
  }
  for (const [name, view] of views)
    if (!status?.cameras.some((c) => c.name === name)) view.card.classList.toggle("stale", !serving);
  const order = status?.cameras.map((c) => views.get(c.name)!.card) ?? [];
  if (order.some((card, i) => grid.children[i] !== card)) grid.append(...order);
  for (const [name, view] of views) {
    if (status && !status.cameras.some((c) => c.name === name)) {
      view.card.remove();
      views.delete(name);
      layers.delete(name);
      if (large === name) enlarge("");
    }
  }
  const now = [...views.values()].map((view) => `${view.camera} ${ratioOf(view)}`).join() + large;
  if (now !== arranged) arrange();
  arranged = now;
}
let arranged = ""; // with these cameras

// ---- The stage: as large pictures as there is room for, beside the scene or above it.
const [gap, caption] = [10, 26]; // CSS pixels: page.css
interface Fit {
  columns: number;
  tallest: number; // of a picture, CSS pixels
  area: number;
}
// The columns in which pictures of these proportions become largest in a box.
function fitInto(ratios: number[], width: number, height: number): Fit {
  let best: Fit = { columns: 1, tallest: 0, area: -1 };
  for (let columns = 1; columns <= Math.max(1, ratios.length); columns++) {
    const rows = Math.ceil(ratios.length / columns);
    const tallest = Math.max(60, (height - gap * (rows - 1)) / rows - caption); // below it nothing can be seen: it scrolls
    const wide = (width - gap * (columns - 1)) / columns;
    const area = ratios.reduce((sum, ratio) => sum + Math.min(wide, tallest * ratio) ** 2 / ratio, 0);
    if (area > best.area + 1) best = { columns, tallest, area };
  }
  return best;
}

const ratioOf = (view: View) => Number(view.card.style.getPropertyValue("--ratio")) || 4 / 3;

// The largest share of the stage's height for pictures that stand above the scene; the scene needs the rest.
const viewsShare = () => (isNarrow() ? 0.42 : forPictures.includes(openTool()) || large ? 0.68 : 0.56);

const isNarrow = () => matchMedia("(max-width: 760px)").matches;

export function arrange(): void {
  const all = [...views.values()];
  const [width, height] = [stage.clientWidth - 20, stage.clientHeight - 20];
  if (width <= 0 || height <= 0 || !all.length) return;
  const ratios = large ? [ratioOf(views.get(large)!)] : all.map(ratioOf);
  const chrome = 56; // of a panel: its title and its edges
  const side = Math.min(560, Math.max(290, width * 0.35));
  const beside = fitInto(ratios, width - side - gap - 24, height - chrome);
  const above = fitInto(ratios, width - 24, height * viewsShare() - chrome);
  const isRow = !isNarrow() && above.area > beside.area;
  const how = isRow ? "row" : "beside";
  if (stage.dataset.cameras !== how) stage.dataset.cameras = how;
  // Beside the scene no wider than they are, and above it no higher: what is left over is the scene's.
  const inRow = (width - side - gap - 24 - gap * (beside.columns - 1)) / beside.columns;
  const least = 440; // of the panel with its title, legend and choice
  const unused = large ? 0 : beside.columns * Math.max(0, inRow - beside.tallest * Math.max(...ratios));
  stage.style.setProperty("--side", `${Math.floor(side + Math.max(0, Math.min(unused, width - side - gap - least)))}px`);
  const share = `${height * viewsShare()}px`;
  const rows = Math.ceil(ratios.length / above.columns);
  const wide = (width - 24 - gap * (above.columns - 1)) / above.columns;
  const tallest = Math.max(...ratios.map((ratio) => Math.min(above.tallest, wide / ratio)));
  const needed = `${Math.ceil(chrome + 2 + rows * (tallest + caption) + gap * (rows - 1))}px`;
  stage.style.setProperty("--views", large || !ratios.length ? share : `min(${share}, ${needed})`);
  // Now measured: what the style sheet gave.
  const [w, h] = [grid.clientWidth, grid.clientHeight];
  if (!large) {
    const fit = fitInto(all.map(ratioOf), w, h);
    const wide = (w - gap * (fit.columns - 1)) / fit.columns;
    grid.style.setProperty("--columns", String(fit.columns));
    grid.style.setProperty("--wide", `${Math.min(wide, fit.tallest * Math.max(...all.map(ratioOf)))}px`);
    for (const view of all) view.card.style.setProperty("--tallest", `${fit.tallest}px`);
    return;
  }
  // One large, the others small in a row under it.
  const others = all.length - 1;
  const small = others ? Math.min(90, h * 0.2) : 0;
  grid.style.setProperty("--columns", String(Math.max(1, others)));
  grid.style.setProperty("--wide", "1fr");
  for (const view of all) view.card.style.setProperty("--tallest", `${view.camera === large ? h - caption - (others ? small + caption + gap : 0) : small}px`);
}

// Removes the pictures of another service.
export function forgetPictures(): void {
  for (const view of views.values()) view.card.remove();
  views.clear();
  large = "";
  arranged = ""; // the next pictures are arranged, also if they are of the same cameras
  document.body.removeAttribute("data-large");
  document.getElementById("no-cameras")!.hidden = false;
}

export function redrawCameras(): void {
  for (const view of views.values()) if (!isHidden(view.canvas)) draw(view);
}
