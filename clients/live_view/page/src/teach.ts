// Teaching a colour: freeze the pictures, point at the object, check the matches, save. Every request carries the whole state of the
// page; replies arrive over the stream.
import { bitmapOf, showLiveMasks } from "./cameras";
import { ask as askService } from "./control";
import { Labels } from "./labels";
import { stepHistory, updateHistory } from "./history";
import type { Color, Ignore, Scene, TaughtCamera, TeachReply } from "./messages";
import { client, serviceOf, store } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

interface Picture {
  camera: string;
  size: [number, number]; // of the camera's image
  image: ImageBitmap;
  mask: ImageBitmap | null;
  canvas: HTMLCanvasElement;
  verdict: HTMLElement;
  cursor: [number, number] | null; // of the keyboard, image pixels
  ranges: HTMLElement;
  drag: [number, number] | null;
  pressed: [number, number] | null; // where a button or finger went down, CSS pixels
  corner: [number, number] | null;
  taught: TaughtCamera | null;
}

let number = 0;
let pending = 0; // number of the pending request
let pictures: Picture[] = [];
let points: { camera: string; pixel: [number, number] }[] = [];
let ignored: Ignore[] = [];
let wider = 0;
let isIgnoring = false;
let hasLearnt = false;
let unconfirmed: string[] = []; // cameras whose suggestion is not confirmed
let saysAlone = false; // Save was pressed once without all confirmations
let least = -Infinity; // of `wider`: no change beyond
let most = Infinity;
let before = ""; // the ranges before the last step
let service = ""; // of these pictures
let radius: number | null = null; // measured, m
let isUndoing = false; // the rectangles that come then are those of before

const panel = $("teach-panel");
const say = (text: string, isBad = false) => {
  $("teach-says").textContent = text;
  $("teach-says").classList.toggle("bad", isBad);
};

async function ask(action: string): Promise<void> {
  const scene = store.scene;
  if (!scene) return say("There is no service to ask.", true);
  const mine = ++number;
  pending = mine;
  const body = JSON.stringify({
    client,
    number: mine,
    host: scene.host,
    pid: scene.pid,
    action,
    target: $<HTMLSelectElement>("teach-target").value,
    points,
    ignored,
    wider,
  });
  update();
  // Again when nothing comes back: a service that has just started may not have met the bridge yet. A second reply to the
  // same request is not waited for any more.
  for (let attempt = 0; attempt < 3; attempt++) {
    try {
      const answer = await fetch("/api/teach", { method: "POST", headers: { "Content-Type": "application/json" }, body });
      if (!answer.ok) throw new Error((await answer.text()).trim());
    } catch (error) {
      pending = 0;
      update();
      return say(`The request did not go through: ${error instanceof Error ? error.message : error}`, true);
    }
    await new Promise((resolve) => setTimeout(resolve, 3000));
    if (pending !== mine) return;
  }
  pending = 0;
  update();
  say("The service did not answer. Is it still running?", true);
}

export async function takeTeachReply(reply: TeachReply): Promise<void> {
  if (reply.client !== client || reply.number !== pending) return;
  pending = 0;
  const stepped = lastStep;
  lastStep = 0;
  if (!reply.granted) {
    wider -= stepped;
    update();
    return say(reply.reason, true);
  }
  say(reply.reason);
  if (/^Saved/.test(reply.reason)) void updateHistory();
  if (reply.cameras.some((c) => c.jpeg)) await showPictures(reply.cameras);
  const ranges = JSON.stringify(reply.cameras.map((c) => c.color));
  if (stepped && ranges === before) {
    // As far as it goes: the counter says how far that is.
    wider -= stepped;
    if (stepped > 0) most = wider;
    else least = wider;
    say(stepped > 0 ? "It does not get wider." : "It does not get narrower.");
  }
  before = ranges;
  for (const taught of reply.cameras) {
    const picture = pictures.find((p) => p.camera === taught.camera);
    if (!picture) continue;
    if (taught.mask) picture.mask = await maskOf(taught);
    picture.taught = taught;
    picture.verdict.textContent = taught.verdict;
    picture.ranges.textContent = taught.pointed ? textOf(taught.color) : "";
    draw(picture);
  }
  // Replies without cameras (rectangles saved, a replay resumed) change nothing here.
  if (reply.cameras.length) {
    hasLearnt = points.length > 0 && reply.cameras.some((c) => c.pointed);
    unconfirmed = reply.cameras.filter((c) => !c.pointed && c.region[0] !== null).map((c) => c.camera);
    radius = reply.radius;
  }
  update();
}

const textOf = ({ hue_deg: h, saturation: s, intensity: i }: Color) =>
  `Hue ${h[0]}–${h[1]}°, saturation ${+s[0].toFixed(2)}–${+s[1].toFixed(2)}, intensity ${+i[0].toFixed(2)}–${+i[1].toFixed(2)}`;

async function maskOf(taught: TaughtCamera): Promise<ImageBitmap> {
  const [w, h] = taught.size;
  const bytes = Uint8Array.from(atob(taught.mask), (c) => c.charCodeAt(0));
  const stride = Math.ceil(w / 8);
  const data = new ImageData(w, h);
  for (let y = 0; y < h; y++)
    for (let x = 0; x < w; x++) {
      const on = (bytes[y * stride + (x >> 3)] >> (7 - (x & 7))) & 1;
      data.data.set(on ? [255, 0, 220, 255] : [0, 0, 0, 120], 4 * (y * w + x));
    }
  return createImageBitmap(data);
}

async function showPictures(cameras: TaughtCamera[]): Promise<void> {
  const scene = store.scene as Scene;
  const grid = $("teach-pictures");
  grid.replaceChildren();
  pictures = [];
  for (const taught of cameras) {
    if (!taught.jpeg) continue;
    const figure = document.createElement("figure");
    figure.className = "camera";
    figure.innerHTML = `<figcaption><b></b></figcaption><canvas tabindex="0" role="application"></canvas><p class="note"></p><p class="note ranges"></p>`;
    figure.querySelector("b")!.textContent = taught.camera;
    grid.append(figure);
    const canvas = figure.querySelector("canvas")!;
    canvas.dataset.camera = taught.camera;
    canvas.setAttribute(
      "aria-label",
      `Frozen picture of ${taught.camera}. Click on the object; or move the cross with the arrow keys (Shift: faster) and press Enter.`,
    );
    const picture: Picture = {
      camera: taught.camera,
      size: scene.cameras.find((c) => c.name === taught.camera)?.size ?? taught.size,
      image: await bitmapOf(taught.jpeg),
      mask: null,
      canvas,
      verdict: figure.querySelector(".note")!,
      ranges: figure.querySelector(".ranges")!,
      pressed: null,
      cursor: null,
      drag: null,
      corner: null,
      taught: null,
    };
    pictures.push(picture);
    attach(picture);
    draw(picture);
  }
}

function attach(picture: Picture): void {
  const { canvas } = picture;
  const pixel = (event: MouseEvent): [number, number] => {
    const r = canvas.getBoundingClientRect();
    return [
      Math.min(picture.size[0] - 1, Math.max(0, Math.round(((event.clientX - r.left) / r.width) * picture.size[0] - 0.5))),
      Math.min(picture.size[1] - 1, Math.max(0, Math.round(((event.clientY - r.top) / r.height) * picture.size[1] - 0.5))),
    ];
  };
  canvas.addEventListener("pointerdown", (event) => {
    picture.pressed = [event.clientX, event.clientY];
    if (pending || !isIgnoring) return;
    canvas.setPointerCapture(event.pointerId);
    picture.drag = picture.corner = pixel(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!picture.drag) return;
    picture.corner = pixel(event);
    draw(picture);
  });
  canvas.addEventListener("pointerup", () => closeRectangle(picture));
  canvas.addEventListener("pointercancel", () => {
    picture.drag = null;
    draw(picture);
  });
  // A click and not a swipe: what began here, and moved no farther than a finger trembles.
  canvas.addEventListener("click", (event) => {
    const [x, y] = picture.pressed ?? [event.clientX, event.clientY];
    picture.pressed = null;
    if (!pending && !isIgnoring && Math.hypot(event.clientX - x, event.clientY - y) < 8) point(picture, pixel(event));
  });
  canvas.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 10 : 1;
    const move: Record<string, [number, number]> = {
      ArrowLeft: [-step, 0],
      ArrowRight: [step, 0],
      ArrowUp: [0, -step],
      ArrowDown: [0, step],
    };
    picture.cursor ??= [Math.round(picture.size[0] / 2), Math.round(picture.size[1] / 2)];
    if (move[event.key]) {
      const [u, v] = picture.cursor;
      picture.cursor = [
        Math.min(picture.size[0] - 1, Math.max(0, u + move[event.key][0])),
        Math.min(picture.size[1] - 1, Math.max(0, v + move[event.key][1])),
      ];
      if (picture.drag) picture.corner = picture.cursor;
      $("teach-cursor").textContent = `${picture.camera}: ${picture.cursor.join(", ")}`;
    } else if (event.key === "Enter" || event.key === " ") {
      if (!isIgnoring) point(picture, picture.cursor);
      else if (picture.drag) closeRectangle(picture);
      else picture.drag = picture.corner = picture.cursor;
    } else if (event.key === "Escape") {
      picture.drag = null;
    } else return;
    event.preventDefault();
    draw(picture);
  });
}

function point(picture: Picture, pixel: [number, number]): void {
  points = points.filter((p) => p.camera !== picture.camera);
  points.push({ camera: picture.camera, pixel });
  least = -Infinity;
  most = Infinity;
  void ask("look");
}

function closeRectangle(picture: Picture): void {
  const { drag, corner } = picture;
  picture.drag = null;
  if (!drag || !corner) return;
  const box: Ignore["box"] = [
    Math.min(drag[0], corner[0]),
    Math.min(drag[1], corner[1]),
    Math.max(drag[0], corner[0]),
    Math.max(drag[1], corner[1]),
  ];
  if (box[2] - box[0] >= 2 && box[3] - box[1] >= 2) {
    ignored.push({ camera: picture.camera, box });
    if (points.length) void ask("look");
  }
  draw(picture);
  update();
}

function draw(picture: Picture): void {
  const { canvas, image, size } = picture;
  const width = Math.max(320, Math.round((canvas.clientWidth || 320) * devicePixelRatio));
  const height = Math.round((width * size[1]) / size[0]);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  const g = canvas.getContext("2d")!;
  const s = width / size[0];
  g.drawImage(image, 0, 0, width, height);
  if (picture.mask && $<HTMLInputElement>("teach-mask").checked) {
    g.globalAlpha = 0.75;
    g.imageSmoothingEnabled = false;
    g.drawImage(picture.mask, 0, 0, width, height);
    g.imageSmoothingEnabled = true;
    g.globalAlpha = 1;
  }
  g.lineWidth = 2 * devicePixelRatio;
  const rectangle = (box: number[], color: string, dashed: boolean) => {
    g.strokeStyle = color;
    g.setLineDash(dashed ? [8, 6] : []);
    g.strokeRect(box[0] * s, box[1] * s, (box[2] - box[0] + 1) * s, (box[3] - box[1] + 1) * s);
    g.setLineDash([]);
  };
  for (const region of ignored)
    if (region.camera === picture.camera) {
      g.fillStyle = "rgb(30 30 30 / 0.55)";
      g.fillRect(region.box[0] * s, region.box[1] * s, (region.box[2] - region.box[0] + 1) * s, (region.box[3] - region.box[1] + 1) * s);
      rectangle(region.box, "white", true);
    }
  if (picture.drag && picture.corner)
    rectangle(
      [
        Math.min(picture.drag[0], picture.corner[0]),
        Math.min(picture.drag[1], picture.corner[1]),
        Math.max(picture.drag[0], picture.corner[0]),
        Math.max(picture.drag[1], picture.corner[1]),
      ],
      "white",
      true,
    );
  const patch = picture.taught?.background_box;
  if (patch?.length === 4 && hasLearnt) {
    // What could be taken for the object: the largest patch of the background that matches, with some air around it.
    const air = 3 / s;
    const box = [patch[0] - air, patch[1] - air, patch[2] + air, patch[3] + air];
    g.lineWidth = 4 * devicePixelRatio;
    rectangle(box, "rgb(0 0 0 / 0.7)", false);
    g.lineWidth = 2 * devicePixelRatio;
    rectangle(box, "#ff9f1c", false);
    // Without a known position, the matches may be the object.
    const isElsewhere = picture.taught!.pointed || picture.taught!.region[0] !== null;
    new Labels(g).add({ text: isElsewhere ? "matches, too" : "matches: the object?", color: "#ff9f1c", x: ((box[0] + box[2]) / 2) * s, y: ((box[1] + box[3]) / 2) * s, radius: ((box[3] - box[1]) / 2) * s });
  }
  const circle = (u: number, v: number, r: number, color: string, dashed: boolean) => {
    g.setLineDash(dashed ? [6, 5] : []);
    for (const [style, w] of [["rgb(0 0 0 / 0.7)", 4], [color, 2]] as const) {
      g.strokeStyle = style;
      g.lineWidth = w * devicePixelRatio;
      g.beginPath();
      g.arc((u + 0.5) * s, (v + 0.5) * s, Math.max(6, r * s), 0, 2 * Math.PI);
      g.stroke();
    }
    g.setLineDash([]);
  };
  const { taught } = picture;
  if (taught && taught.region[0] !== null && taught.region[1] !== null)
    circle(taught.region[0], taught.region[1], (taught.region_radius ?? 4) * 1.3, taught.pointed ? "white" : "#ffd60a", !taught.pointed);
  if (picture.cursor && document.activeElement === canvas) {
    const [x, y] = [(picture.cursor[0] + 0.5) * s, (picture.cursor[1] + 0.5) * s];
    for (const [style, w] of [["black", 3], ["white", 1.5]] as const) {
      g.strokeStyle = style;
      g.lineWidth = w * devicePixelRatio;
      g.beginPath();
      g.moveTo(0, y);
      g.lineTo(width, y);
      g.moveTo(x, 0);
      g.lineTo(x, height);
      g.stroke();
    }
  }
}

function startAgain(): void {
  service = store.scene ? serviceOf(store.scene) : "";
  points = [];
  wider = 0;
  hasLearnt = false;
  unconfirmed = [];
  radius = null;
  least = -Infinity;
  most = Infinity;
  void ask("freeze");
}

function open(): void {
  panel.hidden = false;
  void updateHistory();
  $("teach-open").setAttribute("aria-expanded", "true");
  ignored = (store.scene?.ignored ?? []).map((i) => ({ camera: i.camera, box: [...i.box] as Ignore["box"] }));
  startAgain();
  panel.scrollIntoView({ behavior: "smooth", block: "start" });
  $("teach-title").focus();
}

function close(): void {
  panel.hidden = true;
  updateLiveMasks();
  $("teach-open").setAttribute("aria-expanded", "false");
}

// A step that changes nothing is taken back when the reply comes.
let lastStep = 0;
function widen(step: number): void {
  wider += step;
  lastStep = step;
  if (step > 0) least = -Infinity;
  else most = Infinity;
  void ask("look");
}

function save(): void {
  if (unconfirmed.length && !saysAlone) {
    saysAlone = true;
    update();
    const learnt = pictures.filter((p) => p.taught?.pointed).map((p) => p.camera);
    return say(
      `Not saved yet: confirm the object in ${unconfirmed.join(", ")} first, or it may not be seen there. ` +
        `Or press again to save what was learnt in ${learnt.join(", ")} alone.`,
      true,
    );
  }
  void ask("apply");
}

// Shows the mask in the live pictures, too.
function updateLiveMasks(): void {
  const isShown = !panel.hidden && hasLearnt && $<HTMLInputElement>("teach-mask").checked;
  showLiveMasks(
    isShown
      ? new Map(
          pictures
            .filter((p) => p.taught)
            .map((p) => [p.camera, { color: p.taught!.color, ignored: ignored.filter((i) => i.camera === p.camera).map((i) => i.box) }]),
        )
      : null,
  );
}

function update(): void {
  const busy = pending !== 0;
  updateLiveMasks();
  if (!unconfirmed.length) saysAlone = false;
  panel.setAttribute("aria-busy", String(busy));
  for (const id of ["teach-freeze", "teach-again"]) $<HTMLButtonElement>(id).disabled = busy;
  $<HTMLButtonElement>("teach-save").disabled = busy || !hasLearnt;
  $("teach-save").textContent = saysAlone ? "Save without them" : "Save colour";
  $<HTMLButtonElement>("teach-wider").disabled = busy || !hasLearnt || wider >= most;
  $<HTMLButtonElement>("teach-narrower").disabled = busy || !hasLearnt || wider <= least;
  $<HTMLButtonElement>("teach-save-ignored").disabled = busy || !pictures.length;
  $<HTMLButtonElement>("teach-clear").disabled = !ignored.length;
  updateRadius();
  $("teach-width").textContent = wider === 0 ? "as fitted" : wider > 0 ? `${wider} wider` : `${-wider} narrower`;
}

// Offers the measured radius if it differs from the current one; a save uses it by itself if none is configured.
function updateRadius(): void {
  const button = $<HTMLButtonElement>("teach-radius");
  const inForce = store.scene?.targets.find((t) => t.name === $<HTMLSelectElement>("teach-target").value)?.radius;
  const isOther = radius !== null && inForce !== undefined && Math.abs(radius - inForce) >= 0.0005;
  button.hidden = !hasLearnt || !isOther;
  button.disabled = pending !== 0;
  if (isOther) button.textContent = `Take a radius of ${(1000 * radius!).toFixed(1)} mm instead of ${+(1000 * inForce).toFixed(1)} mm`;
}

async function takeRadius(): Promise<void> {
  if (radius === null) return;
  $<HTMLButtonElement>("teach-radius").disabled = true;
  const reply = await askService("target", "set", $<HTMLSelectElement>("teach-target").value, `radius_m=${radius.toFixed(4)}`);
  say(reply.reason, !reply.granted);
  void updateHistory();
  updateRadius();
}

// Keeps the selected target when the service restarts.
let chosenTarget = "";
function updateTargets(): void {
  const select = $<HTMLSelectElement>("teach-target");
  const names = store.scene?.targets.map((t) => t.name) ?? [];
  if (!names.length || [...select.options].map((o) => o.value).join("\n") === names.join("\n")) return;
  select.replaceChildren(...names.map((name) => new Option(name, name)));
  if (names.includes(chosenTarget)) select.value = chosenTarget;
}

// The current values, without rectangles drawn since.
export function takeSceneForTeaching(scene: Scene): void {
  if (!isUndoing) return;
  isUndoing = false;
  ignored = scene.ignored.map((i) => ({ camera: i.camera, box: [...i.box] as Ignore["box"] }));
  pictures.forEach(draw);
  update();
}

// From the first steps: the target that has no colour yet.
export function openTeaching(target: string): void {
  chosenTarget = target;
  $<HTMLSelectElement>("teach-target").value = target;
  if (panel.hidden) open();
  else startAgain();
}

export function updateTeach(serving: boolean): void {
  const scene = store.scene;
  const button = $<HTMLButtonElement>("teach-open");
  const allowed = serving && !!scene?.may_teach && scene.targets.length > 0;
  updateTargets();
  updateRadius();
  // Another service does not have these pictures.
  if (!panel.hidden && serving && scene && service !== serviceOf(scene)) {
    pictures = [];
    $("teach-pictures").replaceChildren();
    if (allowed) open();
    else close();
  }
  button.disabled = !allowed && panel.hidden;
  $("teach-why").textContent = !serving ? "" : scene && !scene.may_teach ? scene.why_not : scene && !scene.targets.length ? "The configuration has no target to teach." : "";
  $("teach-resume").hidden = !serving || store.status?.mode !== "held";
}

$("teach-open").addEventListener("click", () => (panel.hidden ? open() : close()));
$("teach-resume").addEventListener("click", () => void ask("resume"));
$("teach-close").addEventListener("click", () => {
  close();
  $("teach-open").focus();
});
$("teach-freeze").addEventListener("click", startAgain);
$("teach-again").addEventListener("click", startAgain);
$("teach-wider").addEventListener("click", () => widen(1));
$("teach-narrower").addEventListener("click", () => widen(-1));
$("teach-save").addEventListener("click", save);
$("teach-radius").addEventListener("click", () => void takeRadius());
$("teach-save-ignored").addEventListener("click", () => void ask("ignore"));
for (const word of ["undo", "redo"] as const)
  $(`teach-${word}`).addEventListener("click", async () => {
    isUndoing = true;
    const reply = await stepHistory(word);
    isUndoing &&= reply.granted;
    say(reply.reason, !reply.granted);
  });
$("teach-clear").addEventListener("click", () => {
  ignored = [];
  pictures.forEach(draw);
  if (points.length) void ask("look");
  update();
});
$<HTMLInputElement>("teach-mask").addEventListener("change", () => {
  pictures.forEach(draw);
  updateLiveMasks();
});
$<HTMLInputElement>("teach-ignore").addEventListener("change", (event) => {
  isIgnoring = (event.target as HTMLInputElement).checked;
  $("teach-pictures").classList.toggle("drawing", isIgnoring);
  say(isIgnoring ? "Drag a rectangle over what should never match (with keys: Enter, arrows, Enter)." : "Click on the object in one picture.");
});
$("teach-target").addEventListener("change", () => {
  chosenTarget = $<HTMLSelectElement>("teach-target").value;
  startAgain();
});
addEventListener("resize", () => pictures.forEach(draw));
