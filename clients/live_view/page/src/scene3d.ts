// The scene in three dimensions: cameras, volume, targets with their uncertainty, and where they have been.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Scene } from "./messages";
import { colorOf, store, type Target, type TrackedCamera } from "./store";

const chi95 = Math.sqrt(7.815); // of three dimensions
const trailLength = 300;

class TargetModel {
  readonly group = new THREE.Group();
  private readonly ball: THREE.Mesh<THREE.SphereGeometry, THREE.MeshLambertMaterial>;
  private readonly ellipsoid: THREE.Mesh<THREE.SphereGeometry, THREE.MeshBasicMaterial>;
  private readonly trail: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private readonly drop: THREE.Line;

  constructor(color: THREE.Color, radius: number, private readonly floor: number) {
    this.ball = new THREE.Mesh(
      new THREE.SphereGeometry(radius, 24, 16),
      new THREE.MeshLambertMaterial({ color, emissive: color, emissiveIntensity: 0.35, transparent: true }),
    );
    this.ellipsoid = new THREE.Mesh(
      new THREE.SphereGeometry(1, 24, 16),
      new THREE.MeshBasicMaterial({ color, transparent: true, opacity: 0.22, depthWrite: false }),
    );
    this.trail = new THREE.LineSegments(
      new THREE.BufferGeometry(),
      new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.9 }),
    );
    this.trail.frustumCulled = false;
    this.drop = new THREE.Line(
      new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3(0, 0, -1)]),
      new THREE.LineDashedMaterial({ color, transparent: true, opacity: 0.5, dashSize: 0.03, gapSize: 0.03 }),
    );
    this.drop.frustumCulled = false;
    this.group.add(this.ball, this.ellipsoid, this.trail, this.drop);
  }

  update(target: Target, color: THREE.Color, background: THREE.Color): void {
    const [x, y, z] = target.latest.position;
    const there = x !== null && y !== null && z !== null && performance.now() - target.heard < 2000;
    this.ball.visible = this.ellipsoid.visible = this.drop.visible = there;
    if (there) {
      this.ball.position.set(x, y, z);
      this.ball.material.opacity = target.latest.state === "coasting" ? 0.4 : 1;
      this.drop.geometry.setFromPoints([new THREE.Vector3(x, y, z), new THREE.Vector3(x, y, this.floor)]);
      this.drop.computeLineDistances();
      this.shape(target.latest.covariance, new THREE.Vector3(x, y, z));
    }
    const samples = target.history.slice(-trailLength);
    const points: number[] = [];
    const colors: number[] = [];
    const shade = new THREE.Color();
    for (let i = 1; i < samples.length; i++) {
      const a = samples[i - 1].p;
      const b = samples[i].p;
      if (!a || !b || samples[i].t - samples[i - 1].t > 0.5) continue;
      points.push(...a, ...b);
      for (const k of [i - 1, i]) {
        shade.copy(background).lerp(color, 0.15 + (0.85 * k) / samples.length);
        colors.push(shade.r, shade.g, shade.b);
      }
    }
    this.trail.geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    this.trail.geometry.setAttribute("color", new THREE.Float32BufferAttribute(colors, 3));
  }

  // The ellipsoid is the unit sphere under the Cholesky factor of the covariance.
  private shape(covariance: (number | null)[], at: THREE.Vector3): void {
    if (covariance.some((c) => c === null)) {
      this.ellipsoid.visible = false;
      return;
    }
    const c = covariance as number[];
    const l00 = Math.sqrt(Math.max(c[0], 1e-12));
    const l10 = c[3] / l00;
    const l20 = c[6] / l00;
    const l11 = Math.sqrt(Math.max(c[4] - l10 * l10, 1e-12));
    const l21 = (c[7] - l20 * l10) / l11;
    const l22 = Math.sqrt(Math.max(c[8] - l20 * l20 - l21 * l21, 1e-12));
    this.ellipsoid.matrixAutoUpdate = false;
    // prettier-ignore
    this.ellipsoid.matrix.set(
      chi95 * l00, 0, 0, at.x,
      chi95 * l10, chi95 * l11, 0, at.y,
      chi95 * l20, chi95 * l21, chi95 * l22, at.z,
      0, 0, 0, 1);
  }
}

// The camera that moves: its frustum where it is now, and where it has been.
class TrackedCameraModel {
  readonly group = new THREE.Group();
  private readonly frustum: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private readonly trail: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial>;

  constructor(depth: number) {
    const [w, h] = [0.62 * depth, 0.46 * depth];
    const rim = [[-w, -h], [w, -h], [w, h], [-w, h]].map(([x, y]) => new THREE.Vector3(x, y, depth));
    const eye = new THREE.Vector3();
    this.frustum = new THREE.LineSegments(
      new THREE.BufferGeometry().setFromPoints(rim.flatMap((p, i) => [p, rim[(i + 1) % 4], eye, p])),
      new THREE.LineBasicMaterial(),
    );
    this.trail = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.6 }));
    this.trail.frustumCulled = false;
    this.group.add(this.frustum, this.trail);
  }

  update(camera: TrackedCamera, color: THREE.Color): void {
    const [x, y, z] = camera.latest.position;
    const [qx, qy, qz, qw] = camera.latest.orientation;
    this.frustum.visible = x !== null && y !== null && z !== null && performance.now() - camera.heard < 2000;
    if (this.frustum.visible) {
      this.frustum.position.set(x!, y!, z!);
      this.frustum.quaternion.set(qx!, qy!, qz!, qw!);
    }
    this.frustum.material.color.copy(color);
    this.trail.material.color.copy(color);
    const points: number[] = [];
    for (let i = 1; i < camera.trail.length; i++) {
      const [a, b] = [camera.trail[i - 1], camera.trail[i]];
      if (a.p && b.p && b.t - a.t < 0.5) points.push(...a.p, ...b.p);
    }
    this.trail.geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  }
}

export class Scene3d {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(45, 1.5, 0.01, 100);
  private readonly controls: OrbitControls;
  private readonly still = new THREE.Group(); // what only the scene's message changes
  private readonly models = new Map<string, TargetModel>();
  private readonly cameras = new Map<string, TrackedCameraModel>();
  private shown: Scene | null = null;
  private center = new THREE.Vector3(0, 0, 1);
  private reach = 3;

  // throws when the browser has no WebGL
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x667788, 2.4), this.still);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.home();
  }

  home(): void {
    this.controls.target.copy(this.center);
    this.camera.position.copy(this.center).add(new THREE.Vector3(-0.95, -1.6, 1.05).multiplyScalar(this.reach));
    this.controls.update();
  }

  private key(event: KeyboardEvent): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const s = new THREE.Spherical().setFromVector3(new THREE.Vector3(offset.y, offset.z, offset.x)); // z up
    if (event.key === "ArrowLeft") s.theta -= 0.1;
    else if (event.key === "ArrowRight") s.theta += 0.1;
    else if (event.key === "ArrowUp") s.phi -= 0.1;
    else if (event.key === "ArrowDown") s.phi += 0.1;
    else if (event.key === "+" || event.key === "=") s.radius *= 0.9;
    else if (event.key === "-") s.radius *= 1.1;
    else if (event.key === "Home") return this.home();
    else return;
    event.preventDefault();
    s.makeSafe();
    const v = new THREE.Vector3().setFromSpherical(s);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(v.z, v.x, v.y));
    this.controls.update();
  }

  render(): void {
    const style = getComputedStyle(document.documentElement);
    const background = new THREE.Color(style.getPropertyValue("--panel").trim() || "#fff");
    const ink = new THREE.Color(style.getPropertyValue("--muted").trim() || "#555");
    const key = `${ink.getHexString()}`;
    if (store.scene && (store.scene !== this.shown || this.canvas.dataset.ink !== key)) {
      const moved = this.shown?.rig_identity !== store.scene.rig_identity;
      this.shown = store.scene;
      this.canvas.dataset.ink = key;
      this.build(store.scene, ink);
      if (moved) this.home();
    }
    for (const [name, model] of this.models) {
      if (store.targets.has(name)) continue;
      this.scene.remove(model.group);
      this.models.delete(name);
    }
    for (const target of store.targets.values()) {
      const color = new THREE.Color(colorOf(target.name));
      let model = this.models.get(target.name);
      if (!model && this.shown) {
        const radius = this.shown.targets.find((t) => t.name === target.name)?.radius ?? 0.04;
        model = new TargetModel(color, radius, this.shown.volume[0][2]);
        this.models.set(target.name, model);
        this.scene.add(model.group);
      }
      model?.update(target, color, background);
    }
    const accent = new THREE.Color(style.getPropertyValue("--accent").trim() || "#36c");
    for (const [name, camera] of store.trackedCameras) {
      let model = this.cameras.get(name);
      if (!model) {
        model = new TrackedCameraModel(this.reach * 0.12);
        this.cameras.set(name, model);
        this.scene.add(model.group);
      }
      model.update(camera, accent);
    }
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== w || size.y !== h) {
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      this.renderer.setSize(w, h, false);
      this.camera.aspect = w / Math.max(1, h);
      this.camera.fov = this.camera.aspect < 1 ? 60 : 45; // narrow: everything still fits in
      this.camera.updateProjectionMatrix();
    }
    this.renderer.render(this.scene, this.camera);
  }

  private build(scene: Scene, ink: THREE.Color): void {
    this.still.clear();
    for (const [name, model] of this.models) {
      this.scene.remove(model.group);
      this.models.delete(name);
    }
    const low = new THREE.Vector3(...scene.volume[0]);
    const high = new THREE.Vector3(...scene.volume[1]);
    const size = high.clone().sub(low);
    const bounds = new THREE.Box3(low, high);
    for (const camera of scene.cameras) bounds.expandByPoint(new THREE.Vector3(...camera.position));
    this.center = bounds.getCenter(new THREE.Vector3());
    this.reach = Math.max(bounds.getSize(new THREE.Vector3()).length() * 0.46, 0.2);

    const box = new THREE.LineSegments(
      new THREE.EdgesGeometry(new THREE.BoxGeometry(size.x, size.y, size.z)),
      new THREE.LineBasicMaterial({ color: ink, transparent: true, opacity: 0.55 }),
    );
    box.position.copy(low).add(high).multiplyScalar(0.5);
    this.still.add(box);
    const cell = size.x > 8 ? 1 : size.x > 1.5 ? 0.25 : 0.1; // m
    const grid: THREE.Vector3[] = [];
    for (let x = Math.ceil(low.x / cell) * cell; x <= high.x + 1e-9; x += cell)
      grid.push(new THREE.Vector3(x, low.y, low.z), new THREE.Vector3(x, high.y, low.z));
    for (let y = Math.ceil(low.y / cell) * cell; y <= high.y + 1e-9; y += cell)
      grid.push(new THREE.Vector3(low.x, y, low.z), new THREE.Vector3(high.x, y, low.z));
    this.still.add(
      new THREE.LineSegments(
        new THREE.BufferGeometry().setFromPoints(grid),
        new THREE.LineBasicMaterial({ color: ink, transparent: true, opacity: 0.18 }),
      ),
    );
    const axes = new THREE.AxesHelper(Math.min(size.x, size.y, size.z) / 5);
    this.still.add(axes);
    const depth = this.reach * 0.16;
    for (const camera of scene.cameras) {
      const eye = new THREE.Vector3(...camera.position);
      const rim: THREE.Vector3[] = [];
      for (let i = 0; i + 2 < camera.border.length; i += 3) {
        const [x, y, z] = camera.border.slice(i, i + 3);
        if (x !== null && y !== null && z !== null) rim.push(new THREE.Vector3(x, y, z).multiplyScalar(depth).add(eye));
      }
      const lines: THREE.Vector3[] = [];
      rim.forEach((p, i) => {
        lines.push(p, rim[(i + 1) % rim.length]);
        if (i % (rim.length / 4) === 0) lines.push(eye, p);
      });
      this.still.add(
        new THREE.LineSegments(
          new THREE.BufferGeometry().setFromPoints(lines),
          new THREE.LineBasicMaterial({ color: ink }),
        ),
      );
      const text = sprite(camera.name, `#${ink.getHexString()}`, this.reach * 0.05);
      text.position.copy(eye).add(new THREE.Vector3(0, 0, this.reach * 0.04));
      this.still.add(text);
    }
  }
}

function sprite(text: string, color: string, height: number): THREE.Sprite {
  const canvas = document.createElement("canvas");
  const g = canvas.getContext("2d")!;
  g.font = "600 44px system-ui, sans-serif";
  canvas.width = Math.ceil(g.measureText(text).width) + 12;
  canvas.height = 60;
  g.font = "600 44px system-ui, sans-serif";
  g.fillStyle = color;
  g.textBaseline = "middle";
  g.fillText(text, 6, 30);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false }));
  sprite.scale.set((height * canvas.width) / canvas.height, height, 1);
  return sprite;
}
