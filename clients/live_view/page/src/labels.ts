// Places labels next to the objects in a picture, without covering objects or other labels.

export interface Labelled {
  text: string;
  color: string;
  x: number; // middle of what is named, canvas pixels
  y: number;
  radius: number; // that must stay free around it
}

type Box = [number, number, number, number]; // left, top, right, bottom

const overlap = (a: Box, b: Box) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));

export class Labels {
  private readonly taken: Box[] = [];

  constructor(private readonly g: CanvasRenderingContext2D) {}

  // Boxes that must stay free; all of a picture before its first label.
  keepFree({ x, y, radius }: Labelled): void {
    this.taken.push([x - radius, y - radius, x + radius, y + radius]);
  }

  // The nearest place that covers nothing; where there is none, the one that covers least.
  add({ text, color, x, y, radius }: Labelled): void {
    const { g } = this;
    const scale = devicePixelRatio;
    const size = 12 * scale;
    g.font = `600 ${size}px system-ui, sans-serif`;
    const [w, h] = [g.measureText(text).width + 10 * scale, size + 8 * scale];
    const gap = 4 * scale;
    let best: Box | null = null;
    let least = Infinity;
    for (let ring = 0; ring < 4 && least > 0; ring++) {
      const out = radius + gap + ring * (h + gap);
      // Above, below, right, left, then the corners.
      for (const [dx, dy] of [[0, -1], [0, 1], [1, 0], [-1, 0], [0.7, -0.7], [-0.7, -0.7], [0.7, 0.7], [-0.7, 0.7]]) {
        const left = Math.min(Math.max(x + dx * (out + w / 2) - w / 2, 2), g.canvas.width - w - 2);
        const top = Math.min(Math.max(y + dy * (out + h / 2) - h / 2, 2), g.canvas.height - h - 2);
        const box: Box = [left, top, left + w, top + h];
        const covered = this.taken.reduce((sum, other) => sum + overlap(box, other), 0) + overlap(box, [x - radius, y - radius, x + radius, y + radius]);
        if (covered < least) [best, least] = [box, covered];
        if (covered === 0) break;
      }
    }
    const [left, top, right, bottom] = best!;
    this.taken.push(best!);
    // A line leads from a distant label to its object.
    const [cx, cy] = [Math.min(Math.max(x, left), right), Math.min(Math.max(y, top), bottom)];
    const away = Math.hypot(cx - x, cy - y);
    if (away > radius + 2 * h) {
      g.strokeStyle = color;
      g.lineWidth = 1.2 * scale;
      g.beginPath();
      g.moveTo(cx, cy);
      g.lineTo(cx + ((x - cx) * (away - radius)) / away, cy + ((y - cy) * (away - radius)) / away);
      g.stroke();
    }
    g.fillStyle = "rgb(0 0 0 / 0.62)";
    g.beginPath();
    g.roundRect(left, top, w, h, 4 * scale);
    g.fill();
    g.fillStyle = color;
    g.fillRect(left, bottom - 2 * scale, w, 2 * scale);
    g.fillStyle = "white";
    g.textAlign = "center";
    g.textBaseline = "middle";
    g.fillText(text, left + w / 2, top + h / 2);
  }
}
