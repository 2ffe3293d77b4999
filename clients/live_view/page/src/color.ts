// Visible variants of the targets' colours, which may be as pale as the page.
import { store, targetOf } from "./store";

export type Rgb = [number, number, number]; // 0..255

const linear = (c: number) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
const luminance = ([r, g, b]: Rgb) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);

// WCAG 2.1, 1..21.
export function contrast(a: Rgb, b: Rgb): number {
  const [x, y] = [luminance(a), luminance(b)];
  return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05);
}

export function rgbOf(name: string): Rgb {
  const targets = store.scene?.targets ?? [];
  const target = targetOf(name, targets.map((t) => t.name));
  const rgb = targets.find((t) => t.name === target)?.rgb ?? [0.5, 0.6, 0.9];
  return rgb.map((x) => Math.round(x * 255)) as Rgb;
}

export function colorOf(name: string): string {
  return `rgb(${rgbOf(name).join(", ")})`;
}

// A variable of the style sheet. Asking the browser makes it lay out the page: once for each theme is enough.
const variables = new Map<string, string>();
let variablesOf = "";
export function variable(name: string): string {
  const theme = document.documentElement.dataset.theme ?? "";
  if (theme !== variablesOf) variables.clear();
  variablesOf = theme;
  let value = variables.get(name);
  if (value === undefined) {
    value = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    variables.set(name, value);
  }
  return value;
}

// The target's colour, made lighter until a line of it stands out from the dark rim that is drawn around it.
export function ringColorOf(name: string): string {
  const own = rgbOf(name);
  for (let share = 0; share < 1; share += 0.05) {
    const mixed = own.map((c) => Math.round(c + (255 - c) * share)) as Rgb;
    if (contrast(mixed, [0, 0, 0]) >= 7) return `rgb(${mixed.join(", ")})`;
  }
  return "white";
}

function panel(): Rgb {
  const hex = variable("--panel").replace("#", "");
  return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16) || 0) as Rgb;
}

// How many targets before this one have (nearly) its colour: 0 for the first.
export function likeBefore(name: string): number {
  const own = rgbOf(name);
  const names = store.scene?.targets.map((t) => t.name) ?? [];
  const target = targetOf(name, names);
  // Objects of one target get three shades of its colour.
  if (target !== name) return Number(name.slice(target.length + 1)) % 3;
  const before = names.slice(0, Math.max(0, names.indexOf(name)));
  return before.filter((other) => Math.hypot(...rgbOf(other).map((c, i) => c - own[i])) < 60).length;
}

// The target's colour, made darker (or lighter) until a line of it stands out from a panel: 3:1, as WCAG asks of graphics.
export function lineColorOf(name: string): string {
  const own = rgbOf(name);
  const background = panel();
  const towards = luminance(background) > 0.4 ? 0 : 255;
  const mixed = (share: number) => own.map((c) => Math.round(c + (towards - c) * Math.min(share, 0.85))) as Rgb;
  for (let share = 0; share <= 1; share += 0.05)
    if (contrast(mixed(share), background) >= 3.1) return `rgb(${mixed(share + 0.3 * likeBefore(name)).join(", ")})`;
  return variable("--ink");
}
