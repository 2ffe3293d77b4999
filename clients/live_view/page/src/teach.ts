// Teaching a colour: freeze the big pictures where they are, point at the object in them, check the matches, save. Every request
// carries the whole state of the page; replies arrive over the stream.
import { bitmapOf, clearLayers, hasFocus, redrawLayer, setLayer, type Layer, type Placed } from "./cameras";
import { ask as askService, say as sayIn } from "./control";
import { enable } from "./hints";
import { Labels } from "./labels";
import { stepHistory, updateHistory } from "./history";
import type { Color, Ignore, Scene, TaughtCamera, TeachReply } from "./messages";
import { setOptions } from "./options";
import { send } from "./requests";
import { isOpen, onTool, refuse, show, toast } from "./shell";
import { client, serviceOf, store, withoutService } from "./store";

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

interface Picture {
  camera: string;
  size: [number, number]; // of the camera's image
  image: ImageBitmap;
  mask: ImageBitmap | null;
  cursor: [number, number] | null; // of the keyboard, image pixels
  drag: [number, number] | null; // a rectangle's first corner
  corner: [number, number] | null; // and the other
  taught: TaughtCamera | null;
}

let number = 0; // of the latest request; its answer is taken whenever it comes
let pending = 0; // the same while it is waited for
let asked = ""; // what it was for
let isAnswered = false;
const saves = new Set<number>(); // requests that write a file and have no answer yet
let pictures: Picture[] = [];
let missing: string[] = []; // cameras without a picture in the frozen set
type Point = { camera: string; pixel: [number, number] };
let points: Point[] = [];
let later: Point[] = []; // clicks while the service learns: the next request has them
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
const say = (text: string, isBad = false, isBusy = false) => sayIn($("teach-says"), text, isBad, isBusy);

const doing: Record<string, string> = { freeze: "Freezing the pictures", look: "Learning the colour", apply: "Saving", ignore: "Saving the rectangles", resume: "Going on" };

async function ask(action: string): Promise<void> {
  const scene = store.scene;
  if (!scene) return say("There is no service to ask.", true);
  const mine = ++number;
  pending = mine;
  asked = action;
  isAnswered = false;
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
  if (action === "apply" || action === "ignore") saves.add(mine);
  say(`${doing[action]}…`, false, true);
  update();
  const sent = await send("/api/teach", body, () => mine !== number || isAnswered, (seconds) => {
    if (pending === mine && seconds >= 2 && !later.length) say(`${doing[action]}… ${seconds} s`, false, true);
  });
  if (mine !== number || sent.outcome === "answered") return;
  pending = 0;
  update();
  say(sent.reason, true);
}

export async function takeTeachReply(reply: TeachReply): Promise<void> {
  if (reply.client !== client) return;
  // A save that the page did not wait for: other pictures were asked for meanwhile.
  if (reply.number !== number && saves.delete(reply.number)) return toast(reply.reason);
  if (reply.number !== number || isAnswered) return;
  isAnswered = true;
  saves.delete(number);
  pending = 0;
  // The tool was closed meanwhile: what was saved is said all the same.
  if (!isOpen("teach")) {
    if (asked !== "freeze" && asked !== "look") toast(reply.reason);
    return;
  }
  const stepped = lastStep;
  lastStep = 0;
  if (!reply.granted) {
    wider -= stepped;
    if (askLater()) return;
    update();
    return say(reply.reason, true);
  }
  say(reply.reason);
  if (/^Saved/.test(reply.reason)) {
    void updateHistory();
    if (asked === "apply") letGo(); // the live pictures show what it is tracked by
  }
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
    draw(picture);
  }
  // Replies without cameras (rectangles saved, a replay resumed) change nothing here.
  if (reply.cameras.length) {
    hasLearnt = points.length > 0 && reply.cameras.some((c) => c.pointed);
    unconfirmed = reply.cameras.filter((c) => !c.pointed && c.region[0] !== null).map((c) => c.camera);
    radius = reply.radius;
  }
  if (!askLater()) update();
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

// The frozen pictures take the place of the live ones.
async function showPictures(cameras: TaughtCamera[]): Promise<void> {
  const scene = store.scene as Scene;
  const frozen = await Promise.all(
    cameras
      .filter((taught) => taught.jpeg)
      .map(async (taught): Promise<Picture> => ({
        camera: taught.camera,
        size: scene.cameras.find((c) => c.name === taught.camera)?.size ?? taught.size,
        image: await bitmapOf(taught.jpeg),
        mask: null,
        cursor: null,
        drag: null,
        corner: null,
        taught: null,
      })),
  );
  letGo();
  missing = cameras.filter((taught) => !taught.jpeg).map((taught) => taught.camera);
  pictures = frozen;
  for (const picture of pictures) setLayer(picture.camera, layerOf(picture));
  update();
}

// The live pictures again.
function letGo(): void {
  for (const picture of pictures) {
    setLayer(picture.camera, null);
    picture.image.close();
  }
  pictures = [];
  missing = [];
  later = [];
  awaitPictures();
}

// While the tool is open a click never enlarges: it teaches, or takes pictures to teach in.
function awaitPictures(): void {
  if (isOpen("teach")) for (const { name } of store.scene?.cameras ?? []) setLayer(name, { point: () => !pending && startAgain() });
}

function layerOf(picture: Picture): Layer {
  const { camera } = picture;
  return {
    frozen: { image: picture.image, size: picture.size },
    paint: (on) => paint(picture, on),
    point: (pixel) => {
      if (!isIgnoring) point(picture, pixel);
    },
    drags: () => isIgnoring && !pending,
    drag: (from, to, isEnd) => {
      [picture.drag, picture.corner] = [from, to];
      if (isEnd) closeRectangle(picture);
      else draw(picture);
    },
    key: (event) => key(picture, event),
    label: `Frozen picture of ${camera}. Click on the object; or move the cross with the arrow keys (Shift: faster) and press Enter.`,
  };
}

function key(picture: Picture, event: KeyboardEvent): void {
  const step = event.shiftKey ? 10 : 1;
  const moves: Record<string, [number, number]> = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
  picture.cursor ??= [Math.round(picture.size[0] / 2), Math.round(picture.size[1] / 2)];
  const move = moves[event.key];
  if (move) {
    picture.cursor = picture.cursor.map((at, i) => Math.min(picture.size[i] - 1, Math.max(0, at + move[i]))) as [number, number];
    if (picture.drag) picture.corner = picture.cursor;
    $("teach-cursor").textContent = `${picture.camera}: ${picture.cursor.join(", ")}`;
  } else if (event.key === "Enter" || event.key === " ") {
    if (!isIgnoring) point(picture, picture.cursor);
    else if (pending) return;
    else if (picture.drag) closeRectangle(picture);
    else picture.drag = picture.corner = picture.cursor;
  } else if (event.key === "Escape" && picture.drag) {
    picture.drag = null;
  } else return;
  event.preventDefault();
  draw(picture);
}

function point(picture: Picture, pixel: [number, number]): void {
  const clicked: Point = { camera: picture.camera, pixel };
  if (pending && asked !== "look") return;
  later = [...later.filter((p) => p.camera !== picture.camera), clicked];
  if (!pending) return void askLater();
  say(`${doing.look}… then from ${later.map((p) => p.camera).join(", ")}, too`, false, true);
  draw(picture);
}

// Whether there were clicks to learn from.
function askLater(): boolean {
  if (!later.length || !pictures.length) return false;
  points = [...points.filter((p) => !later.some((other) => other.camera === p.camera)), ...later];
  later = [];
  least = -Infinity;
  most = Infinity;
  void ask("look");
  return true;
}

const boxOf = (a: [number, number], b: [number, number]): Ignore["box"] => [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])];

function closeRectangle(picture: Picture): void {
  const { drag, corner } = picture;
  picture.drag = null;
  if (!drag || !corner) return;
  const box = boxOf(drag, corner);
  if (box[2] - box[0] >= 2 && box[3] - box[1] >= 2) {
    ignored.push({ camera: picture.camera, box });
    if (points.length) void ask("look");
  }
  draw(picture);
  update();
}

const draw = (picture: Picture) => redrawLayer(picture.camera);

// On a dark rim; r in pixels of the screen.
function ring({ g, at, line }: Placed, pixel: [number, number], r: number, color: string, dash: number[]): void {
  const [x, y] = at(...pixel);
  g.setLineDash(dash);
  for (const [style, width] of [["rgb(0 0 0 / 0.7)", 3], [color, 1.5]] as const) {
    g.strokeStyle = style;
    g.lineWidth = width * line;
    g.beginPath();
    g.arc(x, y, r, 0, 2 * Math.PI);
    g.stroke();
  }
  g.setLineDash([]);
}

function paint(picture: Picture, on: Placed): void {
  const { g, at, scale: s, line } = on;
  const { taught } = picture;
  if (picture.mask && $<HTMLInputElement>("teach-mask").checked) {
    g.imageSmoothingEnabled = false;
    on.draw(picture.mask, 0.75);
    g.imageSmoothingEnabled = true;
  }
  const rectangle = ([u0, v0, u1, v1]: number[], color: string, width: number, dash: number[], fill = "") => {
    const [x0, y0] = at(u0 - 0.5, v0 - 0.5), [x1, y1] = at(u1 + 0.5, v1 + 0.5);
    if (fill) {
      g.fillStyle = fill;
      g.fillRect(x0, y0, x1 - x0, y1 - y0);
    }
    g.lineWidth = width;
    g.strokeStyle = color;
    g.setLineDash(dash);
    g.strokeRect(x0, y0, x1 - x0, y1 - y0);
    g.setLineDash([]);
  };
  for (const region of ignored)
    if (region.camera === picture.camera) rectangle(region.box, "white", 1.4 * line, [8, 6], "rgb(30 30 30 / 0.55)");
  if (picture.drag && picture.corner) rectangle(boxOf(picture.drag, picture.corner), "white", 1.4 * line, [8, 6]);
  if (taught?.background_box?.length === 4 && hasLearnt) {
    // What could be taken for the object: the largest patch of the background that matches, with some air around it.
    const air = 3 / s;
    const [u0, v0, u1, v1] = taught.background_box;
    const box = [u0 - air, v0 - air, u1 + air, v1 + air];
    rectangle(box, "rgb(0 0 0 / 0.7)", 3 * line, []);
    rectangle(box, "#ff9f1c", 1.4 * line, []);
    // Without a known position, the matches may be the object.
    const isElsewhere = taught.pointed || taught.region[0] !== null;
    const [x, y] = at((u0 + u1) / 2, (v0 + v1) / 2);
    new Labels(g).add({ text: isElsewhere ? "matches, too" : "matches: the object?", color: "#ff9f1c", x, y, radius: ((v1 - v0) / 2 + air) * s });
  }
  if (taught && taught.region[0] !== null && taught.region[1] !== null) {
    const center: [number, number] = [taught.region[0], taught.region[1]];
    ring(on, center, Math.max(6, (taught.region_radius ?? 4) * 1.3 * s), taught.pointed ? "white" : "#ffd60a", taught.pointed ? [] : [6, 5]);
  }
  const next = later.find((p) => p.camera === picture.camera);
  if (next) ring(on, next.pixel, 6, "#ffd60a", [2, 3]);
  if (!picture.cursor || !hasFocus(picture.camera)) return;
  const [x, y] = at(...picture.cursor);
  for (const [style, width] of [["black", 2.2], ["white", 1.1]] as const) {
    g.strokeStyle = style;
    g.lineWidth = width * line;
    g.beginPath();
    g.moveTo(0, y);
    g.lineTo(g.canvas.width, y);
    g.moveTo(x, 0);
    g.lineTo(x, g.canvas.height);
    g.stroke();
  }
}

function startAgain(): void {
  lastStep = 0;
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

function opened(): void {
  void updateHistory();
  ignored = (store.scene?.ignored ?? []).map((i) => ({ camera: i.camera, box: [...i.box] as Ignore["box"] }));
  updateTargets();
  $("teach-title").focus({ preventScroll: true });
  if (!whyNot()) {
    awaitPictures();
    startAgain();
  }
  update();
}

function closed(): void {
  letGo();
  clearLayers();
  hasLearnt = false;
  pending = 0;
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

function update(): void {
  const busy = pending !== 0;
  if (!unconfirmed.length) saysAlone = false;
  panel.setAttribute("aria-busy", String(busy));
  const wait = busy ? "wait for the service" : "";
  const none = !pictures.length ? "there is no picture yet" : "";
  const unlearnt = hasLearnt && pictures.length ? "" : "click on the object in a picture first";
  enable($("teach-freeze"), wait);
  $("teach-save").textContent = saysAlone ? "Save without them" : "Save colour";
  enable($("teach-save"), wait || unlearnt);
  enable($("teach-wider"), wait || unlearnt || (wider >= most ? "it does not get wider" : ""));
  enable($("teach-narrower"), wait || unlearnt || (wider <= least ? "it does not get narrower" : ""));
  enable($("teach-save-ignored"), wait || none);
  enable($("teach-clear"), ignored.length ? "" : "there are none");
  updateRadius();
  $("teach-width").textContent = wider === 0 ? "as fitted" : wider > 0 ? `${wider} wider` : `${-wider} narrower`;
  listCameras();
}

// What to do in each camera's picture, and what came of it.
function listCameras(): void {
  const names = (store.scene?.cameras ?? []).map((c) => c.name);
  const list = $("teach-cameras");
  list.replaceChildren(
    ...(pictures.length ? names : []).map((camera) => {
      const taught = pictures.find((p) => p.camera === camera)?.taught ?? null;
      const [step, chip, text] = missing.includes(camera)
        ? ["missing", "no picture", `${camera} gave no picture at this moment. New pictures may have one.`]
        : taught?.pointed
          ? ["done", "learnt", taught.verdict]
          : unconfirmed.includes(camera)
            ? ["next", "confirm the ring", taught?.verdict ?? ""]
            : ["next", points.length ? "click on it here" : "click on it", taught?.verdict ?? ""];
      const item = document.createElement("li");
      item.dataset.camera = camera;
      item.dataset.step = step;
      item.innerHTML = `<b></b><span class="chip"></span><p></p><p class="ranges"></p>`;
      item.querySelector("b")!.textContent = camera;
      item.querySelector(".chip")!.textContent = chip;
      item.querySelector("p")!.textContent = text.replace(`camera ${camera}: `, "");
      item.querySelector(".ranges")!.textContent = taught?.pointed ? textOf(taught.color) : "";
      return item;
    }),
  );
}

// Offers the measured radius if it differs from the current one; a save uses it by itself if none is configured.
function updateRadius(): void {
  const button = $<HTMLButtonElement>("teach-radius");
  const inForce = store.scene?.targets.find((t) => t.name === $<HTMLSelectElement>("teach-target").value)?.radius;
  const isOther = radius !== null && inForce !== undefined && Math.abs(radius - inForce) >= 0.0005;
  button.hidden = !hasLearnt || !isOther;
  enable(button, pending ? "wait for the service" : "");
  if (isOther) button.textContent = `Take a radius of ${(1000 * radius!).toFixed(1)} mm (in use: ${+(1000 * inForce).toFixed(1)} mm)`;
}

async function takeRadius(): Promise<void> {
  if (radius === null) return;
  enable($("teach-radius"), "wait for the service");
  say("Working…", false, true);
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
  if (!names.length) return;
  setOptions(select, names.map((name) => [name, name]));
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
  if (isOpen("teach")) startAgain();
  else show("teach");
}

function whyNot(): string {
  const { scene } = store;
  if (!scene || !store.connected) return withoutService();
  if (!scene.may_teach) return scene.why_not;
  return scene.targets.length ? "" : "There is no target yet: add one under Targets.";
}

export function updateTeach(serving: boolean): void {
  const { scene } = store;
  const isShown = isOpen("teach");
  const was = panel.hasAttribute("data-refused");
  if (serving || !isShown || !pictures.length) refuse("teach", serving ? whyNot() : withoutService());
  updateTargets();
  updateRadius();
  // Another service does not have these pictures.
  const isOther = serving && scene && service !== serviceOf(scene);
  if (isShown && serving && !whyNot() && (isOther || (was && !pictures.length && !pending))) {
    letGo();
    ignored = (scene?.ignored ?? []).map((i) => ({ camera: i.camera, box: [...i.box] as Ignore["box"] }));
    startAgain();
  }
  $("teach-resume").hidden = !serving || store.status?.mode !== "held";
}

onTool("teach", { opened, closed });
$("teach-resume").addEventListener("click", () => void ask("resume"));
$("teach-freeze").addEventListener("click", startAgain);
$("teach-wider").addEventListener("click", () => widen(1));
$("teach-narrower").addEventListener("click", () => widen(-1));
$("teach-save").addEventListener("click", save);
$("teach-radius").addEventListener("click", () => void takeRadius());
$("teach-save-ignored").addEventListener("click", () => void ask("ignore"));
for (const word of ["undo", "redo"] as const)
  $(`teach-${word}`).addEventListener("click", async () => {
    isUndoing = true;
    say("Working…", false, true);
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
});
$<HTMLInputElement>("teach-ignore").addEventListener("change", (event) => {
  isIgnoring = (event.target as HTMLInputElement).checked;
  say(isIgnoring ? "Drag a rectangle over what should never match (with keys: Enter, arrows, Enter)." : "Click on the object in one picture.");
});
$("teach-target").addEventListener("change", () => {
  chosenTarget = $<HTMLSelectElement>("teach-target").value;
  startAgain();
});
