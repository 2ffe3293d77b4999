// The frame of the page: which tool is open, the plots' dock, full screen. All of it is remembered in this browser.
import { remember, setting } from "./settings";

export type Tool = "steps" | "calibrate" | "teach" | "adjust" | "controls" | "recordings" | "health" | "more";
type Entry = Tool | "plots";
const panels: Record<Tool, string> = {
  steps: "steps",
  calibrate: "calibrate-panel",
  teach: "teach-panel",
  adjust: "adjust-panel",
  controls: "controls-panel",
  recordings: "recordings",
  health: "health-panel",
  more: "more",
};
const tools = Object.keys(panels) as Tool[];
// Reopened with the page: those that change nothing and freeze nothing.
const lasting: string[] = ["steps", "recordings", "health"];

// Tools that need large pictures.
export const forPictures: string[] = ["teach", "calibrate", "adjust", "controls"];

const $ = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const drawer = $("drawer");
const dock = $("time");
const narrow = matchMedia("(max-width: 760px)");

let open: Tool | "" = "";
let plotsOnPhone = false; // there they take the drawer's place
let plotsBesideTool = false; // where a tool needs their room, they are shown on request only
const needsRoom = (tool: string) => forPictures.includes(tool) && innerHeight < 1000;
const hooks = new Map<Tool, { opened?: () => void; closed?: () => void }>();
let changed = () => {};

export const panelOf = (tool: Tool) => $(panels[tool]);
export const isOpen = (tool: Tool) => open === tool;
export const openTool = () => open;
export const onTool = (tool: Tool, hook: { opened?: () => void; closed?: () => void }) => hooks.set(tool, hook);
// Called after the sizes of the stage's parts may have changed.
export function onLayout(listener: () => void): void {
  changed = listener;
}

function mark(): void {
  const plots = narrow.matches ? plotsOnPhone : needsRoom(open) ? plotsBesideTool : setting("plots", innerHeight >= 800);
  dock.dataset.closed = String(!plots);
  drawer.hidden = open === "";
  document.body.dataset.drawer = open !== "" || (narrow.matches && plots) ? "open" : "";
  document.body.dataset.tool = open;
  for (const button of document.querySelectorAll<HTMLElement>("#tools [data-tool]")) {
    const tool = button.dataset.tool as Entry;
    const isHere = tool === "plots" ? plots : tool === open;
    button.setAttribute("aria-expanded", String(isHere));
  }
  changed();
}

export function show(tool: Tool): void {
  if (open === tool) return;
  plotsOnPhone = plotsBesideTool = false;
  hide(false);
  open = tool;
  panelOf(tool).hidden = false;
  remember("tool", lasting.includes(tool) ? tool : "");
  mark();
  hooks.get(tool)?.opened?.();
}

export function hide(isLast = true): void {
  if (!open) return;
  const tool = open;
  open = "";
  panelOf(tool).hidden = true;
  hooks.get(tool)?.closed?.();
  if (!isLast) return;
  remember("tool", "");
  mark();
}

function togglePlots(): void {
  if (narrow.matches) {
    const was = plotsOnPhone;
    hide(false);
    plotsOnPhone = !was;
  } else if (needsRoom(open)) plotsBesideTool = !plotsBesideTool;
  else remember("plots", dock.dataset.closed === "true");
  mark();
}

// A tool that cannot be used says why, in place of its controls; an empty reason: it can.
export function refuse(tool: Tool, why: string): void {
  const panel = panelOf(tool);
  const text = panel.querySelector<HTMLElement>(".refusal")!;
  if (text.textContent !== why) text.textContent = why;
  text.hidden = !why;
  panel.toggleAttribute("data-refused", why !== "");
}

let toastTimer = 0;
export function toast(text: string): void {
  $("toast").textContent = text;
  $("toast").hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => ($("toast").hidden = true), 8000);
}

// ---- The dock's height, by its edge
const [least, most] = [110, 700]; // CSS pixels: one row of plots; more than a screen's half
function setDock(height: number): void {
  const value = Math.round(Math.min(most, Math.max(least, Math.min(height, innerHeight * 0.6))));
  document.documentElement.style.setProperty("--dock", `${value}px`);
  $("dock-edge").setAttribute("aria-valuenow", String(value));
  remember("dock", value);
  changed();
}
const dockHeight = () => setting("dock", 0) || $("plots").parentElement!.clientHeight; // 0: as high as the style sheet makes it
const edge = $("dock-edge");
edge.addEventListener("pointerdown", (event) => {
  edge.setPointerCapture(event.pointerId);
  const [from, height] = [event.clientY, dockHeight()];
  const move = (to: PointerEvent) => setDock(height + from - to.clientY);
  edge.addEventListener("pointermove", move);
  edge.addEventListener("lostpointercapture", () => edge.removeEventListener("pointermove", move), { once: true });
});
edge.addEventListener("keydown", (event) => {
  const step = { ArrowUp: 20, ArrowDown: -20 }[event.key];
  if (!step) return;
  event.preventDefault();
  setDock(dockHeight() + step);
});

// ---- Buttons
for (const button of document.querySelectorAll<HTMLElement>("#tools [data-tool]"))
  button.addEventListener("click", () => {
    const tool = button.dataset.tool as Entry;
    if (tool === "plots") togglePlots();
    else if (isOpen(tool)) hide();
    else show(tool);
  });
for (const tool of tools)
  $(`${tool === "more" ? "more" : tool}-close`).addEventListener("click", () => {
    hide();
    const opener = $(`${tool}-open`);
    (opener.offsetParent ? opener : $("more-open")).focus({ preventScroll: true });
  });
$("plots-close").addEventListener("click", togglePlots);
for (const button of document.querySelectorAll<HTMLElement>("[data-goto]"))
  button.addEventListener("click", () => (button.dataset.goto === "plots" ? (hide(), togglePlots()) : show(button.dataset.goto as Tool)));
for (const button of document.querySelectorAll<HTMLElement>("[data-click]"))
  button.addEventListener("click", () => $(button.dataset.click!).click());
addEventListener("keydown", (event) => {
  if (event.key === "Escape" && open && drawer.contains(document.activeElement)) $(`${open}-close`).click();
});

// ---- The scene alone
$("scene-full").addEventListener("click", () => {
  if (document.fullscreenElement) void document.exitFullscreen();
  else void $("space").requestFullscreen().catch(() => toast("This browser does not allow a full screen."));
});
document.addEventListener("fullscreenchange", () => {
  $("scene-full").setAttribute("aria-label", document.fullscreenElement ? "Leave the full screen" : "Show the scene full screen");
  changed();
});

// Call it once all tools are set up.
export function restore(): void {
  if (setting("dock", 0)) setDock(setting("dock", 0));
  const last = setting("tool", "");
  mark();
  if (lasting.includes(last) && !narrow.matches) show(last as Tool);
}
narrow.addEventListener("change", mark);
addEventListener("resize", mark);
