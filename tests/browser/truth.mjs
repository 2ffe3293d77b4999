// The films' truth, and the error of the page's positions.
import assert from "node:assert/strict";

// The largest eigenvector of a symmetric 4x4 matrix, which may have negative ones.
function largest(m) {
  const shift = Math.max(...m.map((row) => row.reduce((sum, x) => sum + Math.abs(x), 0)));
  let v = [1, 0.3, 0.2, 0.1];
  for (let i = 0; i < 300; i++) {
    v = m.map((row, r) => row.reduce((sum, x, c) => sum + x * v[c], 0) + shift * v[r]);
    const n = Math.hypot(...v);
    v = v.map((x) => x / n);
  }
  return v;
}
// rms of what is left of b - (R a + t), with the best rotation (Horn 1987) and shift; no scale.
function aligned(a, b) {
  const mean = (points) => [0, 1, 2].map((k) => points.reduce((sum, p) => sum + p[k], 0) / points.length);
  const [ma, mb] = [mean(a), mean(b)];
  const s = [0, 1, 2].map((r) => [0, 1, 2].map((c) => a.reduce((sum, p, i) => sum + (p[r] - ma[r]) * (b[i][c] - mb[c]), 0)));
  const [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
  const [w, x, y, z] = largest([
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ]);
  const turn = ([px, py, pz]) => [
    (w * w + x * x - y * y - z * z) * px + 2 * (x * y - w * z) * py + 2 * (x * z + w * y) * pz,
    2 * (x * y + w * z) * px + (w * w - x * x + y * y - z * z) * py + 2 * (y * z - w * x) * pz,
    2 * (x * z - w * y) * px + 2 * (y * z + w * x) * py + (w * w - x * x - y * y + z * z) * pz,
  ];
  const left = a.reduce((sum, p, i) => sum + Math.hypot(...turn(p.map((v, k) => v - ma[k])).map((v, k) => v - (b[i][k] - mb[k]))) ** 2, 0);
  return Math.sqrt(left / a.length);
}
// How far positions are from a ball that is at ball(t), t seconds after its path began anew, every round_s: rms, m. When that was and
// where the world is are not known: the time and the place that fit best count.
export function rmsOf(positions, ball, round_s) {
  const found = positions.map(({ position }) => position);
  const rms = (begin) => aligned(positions.map(({ t }) => ball(t - begin)), found);
  let [begin, step] = [positions[0].t, 0.01];
  const times = Array.from({ length: Math.ceil(round_s / step) }, (_, k) => begin - k * step);
  begin = times.reduce((a, b) => (rms(b) < rms(a) ? b : a));
  for (; step > 1e-5; step /= 2) for (const other of [begin - step, begin + step]) if (rms(other) < rms(begin)) begin = other;
  return rms(begin);
}

// The next positions while it is tracked, as the page's stream has them.
export const trackedPositions = (page, count) => page.evaluate((count) => new Promise((resolve) => {
  const got = [];
  const events = new EventSource("/api/v1/positions");
  events.addEventListener("position", ({ data }) => {
    const p = JSON.parse(data);
    if (p.state === "tracking") got.push({ t: p.t, position: p.position });
    if (got.length >= count) events.close(), resolve(got);
  });
}), count);

// Where the ball is in a frozen picture, for somebody who sees lime in a grey room; pixels of the canvas as it is shown.
export async function limeIn(canvas) {
  const found = await canvas.evaluate((canvas) => {
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    let [u, v, n] = [0, 0, 0];
    for (let i = 0; i < width * height; i++) {
      const [r, g, b] = data.subarray(4 * i, 4 * i + 3);
      if (g > 100 && g - b > 80 && g >= r) (u += i % width), (v += Math.floor(i / width)), n++;
    }
    const box = canvas.getBoundingClientRect();
    return n ? { x: (u / n / width) * box.width, y: (v / n / height) * box.height } : null;
  });
  assert.ok(found, "the ball is in the picture");
  return found;
}
