// A histogram of a picture's intensities; the shaded ends show no colour.
import type { Light } from "./cameras";
import { variable } from "./color";

const [w, h] = [128, 40]; // CSS pixels
const percent = (share: number) => `${Math.round(100 * share)} %`;

export function drawLight(canvas: HTMLCanvasElement, camera: string, light: Light): void {
  if (canvas.width !== 2 * w) [canvas.width, canvas.height] = [2 * w, 2 * h];
  canvas.setAttribute("aria-label", `Intensities of ${camera}: ${percent(light.dark)} dark, ${percent(light.bright)} white`);
  const g = canvas.getContext("2d")!;
  g.setTransform(2, 0, 0, 2, 0, 0);
  g.clearRect(0, 0, w, h);
  g.fillStyle = variable("--line");
  g.fillRect(0, 0, light.least * w, h);
  g.fillRect(light.most * w, 0, w, h);
  g.fillStyle = variable("--accent");
  const tallest = Math.max(...light.histogram, 1);
  const bar = w / light.histogram.length;
  light.histogram.forEach((count, i) => g.fillRect(i * bar, h - (h * count) / tallest, bar - 0.5, (h * count) / tallest));
}
