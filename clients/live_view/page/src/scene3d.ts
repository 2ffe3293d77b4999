// The scene in 3-D: cameras, volume, targets with their uncertainty and trails; tracked cameras with their maps.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import { colorOf, lineColorOf, variable } from "./color";
import type { CameraMap, N, Scene, SceneCamera } from "./messages";
import { lately, store, targetOf, type Target, type TrackedCamera } from "./store";

const chi95 = Math.sqrt(7.815); // of three dimensions
const trailSeconds = 10;
const roamSeconds = 30; // trail of a tracked camera that must fit into the view
const labelHeight = 13; // CSS pixels, however far away

// The matrix that makes the unit sphere the 95 % ellipsoid: the Cholesky factor of the covariance (xx xy xz yy yz zz).
function ellipsoidMatrix(c: number[], at: THREE.Vector3, matrix: THREE.Matrix4): THREE.Matrix4 {
  const l00 = Math.sqrt(Math.max(c[0], 1e-12));
  const l10 = c[1] / l00;
  const l20 = c[2] / l00;
  const l11 = Math.sqrt(Math.max(c[3] - l10 * l10, 1e-12));
  const l21 = (c[4] - l20 * l10) / l11;
  const l22 = Math.sqrt(Math.max(c[5] - l20 * l20 - l21 * l21, 1e-12));
  // prettier-ignore
  return matrix.set(
    chi95 * l00, 0, 0, at.x,
    chi95 * l10, chi95 * l11, 0, at.y,
    chi95 * l20, chi95 * l21, chi95 * l22, at.z,
    0, 0, 0, 1);
}

interface Place {
  t: number;
  p: [number, number, number] | null;
}
const longestGap = 0.5; // s; the path in between is unknown
const leastStep = 0.004; // m; less may be noise, and has no direction
const leastTurn = Math.cos(0.15); // rad; an arc of a metre's radius is then drawn within 3 mm

// Simplifies a path to its bends, its ends and its gaps: a quarter of the work without a graphics card.
function bends(points: Place[]): (Place & { isAfterGap: boolean })[] {
  const way: (Place & { isAfterGap: boolean })[] = [];
  let last: Place | null = null; // the previous one
  let from: Place | null = null; // where the last step began
  let direction: number[] | null = null; // since the last bend
  for (const place of points) {
    if (!place.p) continue;
    const isAfterGap = !last || place.t - last.t > longestGap;
    if (isAfterGap) {
      if (last && way.at(-1)?.t !== last.t) way.push({ ...last, isAfterGap: false });
      way.push({ ...place, isAfterGap: true });
      [from, direction] = [place, null];
    } else {
      const step = place.p.map((v, i) => v - from!.p![i]);
      const length = Math.hypot(...step);
      if (length >= leastStep) {
        const now = step.map((v) => v / length);
        direction ??= now;
        if (now.reduce((sum, v, i) => sum + v * direction![i], 0) < leastTurn) {
          way.push({ ...from!, isAfterGap: false });
          direction = now;
        }
        from = place;
      }
    }
    last = place;
  }
  if (last && way.at(-1)?.t !== last.t) way.push({ ...last, isAfterGap: false });
  return way;
}

// A line that fades with age, as segments because it may have gaps. One pixel wide without a graphics card, which halves the cost.
class Trail {
  readonly line: THREE.Object3D;
  private readonly thin: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial> | null = null;
  private readonly wide: LineSegments2 | null = null;
  constructor(isSlow: boolean) {
    if (isSlow) this.line = this.thin = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true }));
    else this.line = this.wide = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({ linewidth: 2.5, vertexColors: true, transparent: true }));
    this.line.frustumCulled = false;
  }
  update(points: Place[], color: THREE.Color, background: THREE.Color): void {
    const positions: number[] = [];
    const colors: number[] = [];
    const shade = new THREE.Color();
    const way = bends(points);
    const [begin, end] = [way[0]?.t ?? 0, way.at(-1)?.t ?? 1];
    for (let i = 1; i < way.length; i++) {
      const [a, b] = [way[i - 1], way[i]];
      if (!a.p || !b.p || b.isAfterGap) continue;
      positions.push(...a.p, ...b.p);
      for (const { t } of [a, b]) {
        shade.copy(background).lerp(color, 0.35 + (0.65 * (t - begin)) / Math.max(1e-9, end - begin));
        colors.push(shade.r, shade.g, shade.b);
      }
    }
    this.line.visible = positions.length > 0;
    if (!positions.length) return;
    if (this.thin) {
      this.thin.geometry.dispose();
      this.thin.geometry = new THREE.BufferGeometry();
      this.thin.geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
      this.thin.geometry.setAttribute("color", new THREE.Float32BufferAttribute(colors, 3));
    } else {
      this.wide!.geometry.dispose();
      this.wide!.geometry = new LineSegmentsGeometry();
      this.wide!.geometry.setPositions(positions);
      this.wide!.geometry.setColors(colors);
    }
  }
  dispose(): void {
    for (const line of [this.thin, this.wide]) {
      line?.geometry.dispose();
      line?.material.dispose();
    }
  }
}

class TargetModel {
  readonly group = new THREE.Group();
  readonly label: Label;
  private readonly ball: THREE.Mesh<THREE.SphereGeometry, THREE.MeshLambertMaterial>;
  private readonly ellipsoid: THREE.Mesh<THREE.SphereGeometry, THREE.MeshBasicMaterial>;
  private readonly drop: THREE.Line<THREE.BufferGeometry, THREE.LineDashedMaterial>;
  private readonly trail: Trail;

  constructor(
    name: string,
    private readonly radius: number,
    private readonly floor: number,
    isSlow: boolean,
  ) {
    this.trail = new Trail(isSlow);
    const [around, down] = isSlow ? [14, 9] : [24, 16];
    this.ball = new THREE.Mesh(new THREE.SphereGeometry(radius, around, down), new THREE.MeshLambertMaterial({ transparent: true }));
    this.ellipsoid = new THREE.Mesh(
      new THREE.SphereGeometry(1, around, down),
      new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.75, depthWrite: false }),
    );
    // The ball is clear glass around its ellipsoid, which mostly is the smaller one.
    this.ball.material.depthWrite = false;
    this.ball.renderOrder = 1;
    this.ellipsoid.matrixAutoUpdate = false;
    this.drop = new THREE.Line(
      new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3(0, 0, -1)]),
      new THREE.LineDashedMaterial({ transparent: true, opacity: 0.7, dashSize: 0.03, gapSize: 0.03 }),
    );
    this.drop.frustumCulled = false;
    this.label = new Label(name);
    this.group.add(this.ball, this.ellipsoid, this.trail.line, this.drop, this.label.sprite);
  }

  update(target: Target, background: THREE.Color): void {
    const own = new THREE.Color(colorOf(target.name));
    const lines = new THREE.Color(lineColorOf(target.name));
    this.ball.material.color.copy(own);
    this.ball.material.emissive.copy(own).multiplyScalar(0.35);
    this.ellipsoid.material.color.copy(lines);
    this.drop.material.color.copy(lines);
    const [x, y, z] = target.latest.position;
    const there = x !== null && y !== null && z !== null && performance.now() - target.receivedAt < 2000;
    this.ball.visible = this.ellipsoid.visible = this.drop.visible = this.label.sprite.visible = there;
    if (there) {
      const at = new THREE.Vector3(x, y, z);
      this.ball.position.copy(at);
      this.label.sprite.position.copy(at).setZ(z + 1.6 * this.radius);
      this.ball.material.opacity = target.latest.state === "coasting" ? 0.2 : 0.45;
      this.drop.geometry.setFromPoints([at, at.clone().setZ(this.floor)]);
      this.drop.computeLineDistances();
      const c = target.latest.covariance;
      this.ellipsoid.visible = c.every((v) => v !== null);
      if (this.ellipsoid.visible) ellipsoidMatrix([0, 1, 2, 4, 5, 8].map((i) => c[i]!), at, this.ellipsoid.matrix);
    }
    this.trail.update(lately(target.history, trailSeconds), lines, background);
  }

  dispose(): void {
    this.trail.dispose();
    this.label.dispose();
    for (const part of [this.ball, this.ellipsoid, this.drop]) {
      part.geometry.dispose();
      part.material.dispose();
    }
  }
}

// A tracked camera: frustum, trail and map.
class TrackedCameraModel {
  readonly group = new THREE.Group();
  readonly label: Label;
  private readonly frustum: LineSegments2;
  private readonly frustumMaterial = new LineMaterial({ linewidth: 2.5 });
  private readonly trail: Trail;
  private readonly points: THREE.Points<THREE.BufferGeometry, THREE.PointsMaterial>;
  private ellipsoids: THREE.InstancedMesh<THREE.IcosahedronGeometry, THREE.MeshBasicMaterial> | null = null;
  private shown: CameraMap | null = null;
  private shownWith = "";

  constructor(
    name: string,
    camera: SceneCamera | undefined,
    isSlow: boolean,
  ) {
    this.trail = new Trail(isSlow);
    const depth = 1; // scaled in update()
    const [fx, fy, cx, cy] = camera?.intrinsics ?? [500, 500, 319.5, 239.5];
    const [w, h] = camera?.size ?? [640, 480];
    const rim = [[-0.5, -0.5], [w - 0.5, -0.5], [w - 0.5, h - 0.5], [-0.5, h - 0.5]].map(
      ([u, v]) => new THREE.Vector3(((u - cx) / fx) * depth, ((v - cy) / fy) * depth, depth),
    );
    const eye = new THREE.Vector3();
    const corners = rim.flatMap((p, i) => [p, rim[(i + 1) % 4], eye, p]);
    const geometry = new LineSegmentsGeometry();
    geometry.setPositions(corners.flatMap((p) => p.toArray()));
    this.frustum = new LineSegments2(geometry, this.frustumMaterial);
    this.points = new THREE.Points(
      new THREE.BufferGeometry(),
      new THREE.PointsMaterial({ size: 3.5 * Math.min(devicePixelRatio, 2), sizeAttenuation: false, vertexColors: true }),
    );
    this.points.frustumCulled = false;
    this.label = new Label(name);
    this.group.add(this.frustum, this.trail.line, this.points, this.label.sprite);
  }

  // size: of all that is shown, m.
  update(camera: TrackedCamera, color: THREE.Color, background: THREE.Color, size: number): void {
    const { latest } = camera;
    const there = !!latest && latest.position.every((v) => v !== null) && performance.now() - camera.receivedAt < 2000;
    this.frustum.visible = this.label.sprite.visible = there;
    if (there) {
      const at = new THREE.Vector3(...(latest.position as [number, number, number]));
      this.frustum.position.copy(at);
      this.frustum.scale.setScalar(size * 0.09);
      this.frustum.quaternion.set(...(latest.orientation as [number, number, number, number]));
      this.label.sprite.position.copy(at).setZ(at.z + size * 0.03);
    }
    this.frustumMaterial.color.copy(color);
    this.trail.update(lately(camera.history, 2 * trailSeconds), color, background);
    const theme = document.documentElement.dataset.theme ?? "";
    if (camera.map && (camera.map !== this.shown || theme !== this.shownWith)) this.showMap(camera.map, size);
    this.shownWith = theme;
  }

  private showMap(map: CameraMap, size: number): void {
    this.shown = map;
    const palette = {
      found: new THREE.Color(variable("--good")),
      missed: new THREE.Color(variable("--bad")),
      not_sought: new THREE.Color(variable("--muted")),
    };
    const known = map.points.filter((p) => p.position.every((v) => v !== null));
    const at = (p: (typeof known)[0]) => new THREE.Vector3(...(p.position as [number, number, number]));
    this.points.geometry.dispose();
    this.points.geometry = new THREE.BufferGeometry();
    this.points.geometry.setAttribute("position", new THREE.Float32BufferAttribute(known.flatMap((p) => p.position as number[]), 3));
    this.points.geometry.setAttribute("color", new THREE.Float32BufferAttribute(known.flatMap((p) => palette[p.state].toArray()), 3));
    // A huge ellipsoid would only hide the rest.
    const sure = known.filter(
      (p) => p.covariance.every((v) => v !== null) && Math.max(p.covariance[0]!, p.covariance[3]!, p.covariance[5]!) < (0.07 * size) ** 2,
    );
    if (this.ellipsoids) {
      this.group.remove(this.ellipsoids);
      this.ellipsoids.dispose();
      this.ellipsoids.geometry.dispose();
      this.ellipsoids.material.dispose();
    }
    this.ellipsoids = new THREE.InstancedMesh(
      new THREE.IcosahedronGeometry(1, 1),
      new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.22, depthWrite: false }),
      Math.max(1, sure.length),
    );
    this.ellipsoids.count = sure.length;
    this.ellipsoids.frustumCulled = false;
    const matrix = new THREE.Matrix4();
    sure.forEach((p, i) => {
      this.ellipsoids!.setMatrixAt(i, ellipsoidMatrix(p.covariance as number[], at(p), matrix));
      this.ellipsoids!.setColorAt(i, palette[p.state]);
    });
    this.group.add(this.ellipsoids);
  }

  dispose(): void {
    this.trail.dispose();
    this.label.dispose();
    this.frustum.geometry.dispose();
    this.frustumMaterial.dispose();
    this.points.geometry.dispose();
    this.points.material.dispose();
    this.ellipsoids?.geometry.dispose();
    this.ellipsoids?.material.dispose();
  }
}

// A label of constant size on the screen, with a rim.
class Label {
  readonly sprite: THREE.Sprite;
  private readonly canvas = document.createElement("canvas");
  private drawn = "";
  constructor(private readonly text: string) {
    this.sprite = new THREE.Sprite(
      new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(this.canvas), depthTest: false, sizeAttenuation: false }),
    );
    this.sprite.renderOrder = 2;
    this.sprite.center.set(0.5, 0);
  }
  // Rows above its place, so that it covers no other.
  raise(rows: number): void {
    this.sprite.center.set(0.5, -rows);
  }
  // CSS pixels.
  get width(): number {
    return this.canvas.width / Math.min(devicePixelRatio, 2);
  }
  // perPixel: what a CSS pixel is at a distance of 1.
  update(ink: string, rim: string, perPixel: number): void {
    const scale = Math.min(devicePixelRatio, 2);
    if (this.drawn !== ink + rim) {
      this.drawn = ink + rim;
      const g = this.canvas.getContext("2d")!;
      const font = `600 ${labelHeight * scale}px system-ui, sans-serif`;
      g.font = font;
      this.canvas.width = Math.ceil(g.measureText(this.text).width) + 8 * scale;
      this.canvas.height = Math.ceil(labelHeight * 1.5 * scale);
      g.font = font;
      g.textBaseline = "middle";
      g.lineJoin = "round";
      g.lineWidth = 3 * scale;
      g.strokeStyle = rim;
      g.strokeText(this.text, 4 * scale, this.canvas.height / 2);
      g.fillStyle = ink;
      g.fillText(this.text, 4 * scale, this.canvas.height / 2);
      this.sprite.material.map!.dispose();
      const texture = new THREE.CanvasTexture(this.canvas);
      texture.colorSpace = THREE.SRGBColorSpace;
      texture.minFilter = THREE.LinearFilter;
      this.sprite.material.map = texture;
    }
    this.sprite.scale.set((this.canvas.width / scale) * perPixel, (this.canvas.height / scale) * perPixel, 1);
  }
  dispose(): void {
    this.sprite.material.map?.dispose();
    this.sprite.material.dispose();
  }
}

// Whether WebGL is rendered by the processor (no graphics card).
function hasSoftwareGraphics(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return false; // then there is no view at all
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

export class Scene3d {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(40, 1.5, 0.01, 200);
  private readonly controls: OrbitControls;
  private readonly still = new THREE.Group(); // what only the scene's message changes
  private readonly models = new Map<string, TargetModel>();
  private readonly tracked = new Map<string, TrackedCameraModel>();
  private labels: Label[] = []; // of the still things
  private shown: Scene | null = null;
  private shownWith = "";
  private extent: THREE.Vector3[] = [new THREE.Vector3(-1, -1, 0), new THREE.Vector3(1, 1, 2)]; // what has to fit in
  // Of tracked cameras: their maps, and where they were.
  private readonly roamed = new Map<string, { map: CameraMap | null; cloud: THREE.Vector3[]; way: THREE.Vector3[] }>();
  private reach = 3;
  private isTouched = false; // the user has turned it
  readonly isSlow = hasSoftwareGraphics();
  onTurned: () => void = () => {}; // called after the user changed the view

  // throws when the browser has no WebGL
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.isSlow, alpha: true });
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x667788, 2.4), this.still);
    this.controls = new OrbitControls(this.camera, canvas);
    canvas.style.touchAction = ""; // the style sheet's
    canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }));
    this.controls.enableDamping = false;
    this.controls.addEventListener("start", () => (this.isTouched = true));
    this.controls.addEventListener("change", () => this.onTurned());
    canvas.addEventListener("keydown", (event) => this.key(event));
    this.home();
  }

  home(): void {
    this.isTouched = false;
    this.fit();
  }

  // Everything in view, and no farther away than that needs.
  private fit(share = 0.9): void {
    const back = new THREE.Vector3(-0.5, -0.84, 0.5).normalize(); // from the middle to the eye
    const right = new THREE.Vector3(0, 0, 1).cross(back).normalize();
    const up = back.clone().cross(right);
    const tan = Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2)) * share; // the rest is a margin
    const [width, height] = [Math.max(1, this.canvas.clientWidth), Math.max(1, this.canvas.clientHeight)];
    const tanY = tan * Math.max(0.6, 1 - (4.5 * labelHeight) / height); // a label above and below
    const tanX = tan * this.camera.aspect * Math.max(0.6, 1 - 50 / width); // half a label on either side
    const points = [...this.extent];
    for (const { cloud, way } of this.roamed.values()) points.push(...cloud, ...way);
    const center = new THREE.Box3().setFromPoints(points).getCenter(new THREE.Vector3());
    let distance = 1;
    for (let round = 0; round < 4; round++) {
      distance = 0.05;
      for (const p of points) {
        const q = p.clone().sub(center);
        distance = Math.max(distance, q.dot(back) + Math.abs(q.dot(right)) / tanX, q.dot(back) + Math.abs(q.dot(up)) / tanY);
      }
      // Perspective makes the near side larger: the middle of what is seen goes to the middle of the picture.
      const seen = points.map((p) => {
        const q = p.clone().sub(center);
        const depth = distance - q.dot(back);
        return [q.dot(right) / depth, q.dot(up) / depth];
      });
      const middle = [0, 1].map((i) => (Math.max(...seen.map((s) => s[i])) + Math.min(...seen.map((s) => s[i]))) / 2);
      center.addScaledVector(right, middle[0] * distance).addScaledVector(up, middle[1] * distance);
    }
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(back, distance);
    this.controls.update();
  }

  // How large what is shown is, m.
  private size(): number {
    const points = [...this.extent];
    for (const { cloud, way } of this.roamed.values()) points.push(...cloud, ...way);
    return new THREE.Box3().setFromPoints(points).getSize(new THREE.Vector3()).length();
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
    else if (event.key === "Home") {
      event.preventDefault();
      return this.home();
    } else return;
    event.preventDefault();
    this.isTouched = true;
    s.makeSafe();
    const v = new THREE.Vector3().setFromSpherical(s);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(v.z, v.x, v.y));
    this.controls.update();
  }

  render(): void {
    const theme = document.documentElement.dataset.theme ?? "";
    const background = new THREE.Color(variable("--panel"));
    const ink = new THREE.Color(variable("--muted"));
    const trackedNow = [...store.trackedCameras.keys()].join();
    const how = theme + trackedNow;
    if (!store.scene && this.shown) {
      this.shown = null;
      this.clear();
    }
    if (store.scene && (store.scene !== this.shown || this.shownWith !== how)) {
      const isOther = this.shown?.rig_identity !== store.scene.rig_identity;
      if (isOther) this.roamed.clear();
      this.shown = store.scene;
      this.shownWith = how;
      this.build(store.scene, ink);
      if (isOther) this.isTouched = false;
      if (!this.isTouched) this.fit();
    }
    for (const [name, model] of this.models) if (!store.targets.has(name)) this.drop(this.models, name, model);
    for (const [name, model] of this.tracked) if (!store.trackedCameras.has(name)) this.drop(this.tracked, name, model);
    for (const target of store.targets.values()) {
      let model = this.models.get(target.name);
      if (!model && this.shown) {
        const radius = this.shown.targets.find((t) => t.name === targetOf(target.name, this.shown!.targets.map((t) => t.name)))?.radius ?? 0.04;
        model = new TargetModel(target.name, radius, this.shown.volume[0][2], this.isSlow);
        this.models.set(target.name, model);
        this.scene.add(model.group);
      }
      model?.update(target, background);
    }
    const accent = new THREE.Color(variable("--accent"));
    for (const [name, camera] of store.trackedCameras) {
      let model = this.tracked.get(name);
      if (!model && this.shown) {
        model = new TrackedCameraModel(name, this.shown.cameras.find((c) => c.name === name), this.isSlow);
        this.tracked.set(name, model);
        this.scene.add(model.group);
      }
      this.follow(name, camera);
      model?.update(camera, accent, background, this.size());
    }
    const { clientWidth: w, clientHeight: h } = this.canvas;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== w || size.y !== h) {
      this.renderer.setPixelRatio(this.isSlow ? 1 : Math.min(devicePixelRatio, 2));
      this.renderer.setSize(w, h, false);
      this.camera.aspect = w / Math.max(1, h);
      this.camera.updateProjectionMatrix();
      if (!this.isTouched) this.fit();
    }
    const perPixel = (2 * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2))) / Math.max(1, h);
    const rim = variable("--panel");
    for (const label of this.labels) label.update(variable("--muted"), rim, perPixel);
    for (const model of [...this.models.values(), ...this.tracked.values()]) model.label.update(variable("--ink"), rim, perPixel);
    this.spread(w, h);
    this.renderer.render(this.scene, this.camera);
  }

  // Labels that would cover each other move up, row by row.
  private spread(w: number, h: number): void {
    const row = labelHeight * 1.5;
    const taken: [number, number, number][] = []; // left, right, bottom
    for (const label of [...[...this.models.values(), ...this.tracked.values()].map((m) => m.label), ...this.labels]) {
      if (!label.sprite.visible) continue;
      const at = label.sprite.getWorldPosition(new THREE.Vector3()).project(this.camera);
      const x = ((at.x + 1) / 2) * w;
      const y = ((1 - at.y) / 2) * h;
      let rows = 0;
      const half = label.width / 2 - 2;
      while (rows < 4 && taken.some(([l, r, b]) => x - half < r && l < x + half && Math.abs(y - rows * row - b) < row * 0.8)) rows++;
      label.raise(rows);
      taken.push([x - half, x + half, y - rows * row]);
    }
  }

  // Extends the view by a camera's trail and map, in steps.
  private follow(name: string, camera: TrackedCamera): void {
    const old = this.roamed.get(name);
    let cloud = old?.cloud ?? [];
    if (camera.map && camera.map !== old?.map) {
      const known = camera.map.points.filter((p) => p.position.every((v) => v !== null)).map((p) => p.position as number[]);
      // Ignores a map's outliers.
      const range = [0, 1, 2].map((i) => {
        const sorted = known.map((p) => p[i]).sort((a, b) => a - b);
        const cut = Math.floor(sorted.length * 0.02);
        return [sorted[cut], sorted[sorted.length - 1 - cut]];
      });
      cloud = known.filter((p) => p.every((v, i) => v >= range[i][0] && v <= range[i][1])).map(([x, y, z]) => new THREE.Vector3(x, y, z));
    }
    const way: THREE.Vector3[] = [];
    const recent = lately(camera.history, roamSeconds);
    for (let i = 0; i < recent.length; i += 15) {
      const p = recent[i].p;
      if (p) way.push(new THREE.Vector3(...p));
    }
    const now = camera.latest?.position;
    if (now && now.every((v) => v !== null)) way.push(new THREE.Vector3(...(now as [number, number, number])));
    this.roamed.set(name, { map: camera.map, cloud, way });
    const isOut = (p: THREE.Vector3) => {
      const { x, y, z } = p.clone().project(this.camera);
      return Math.abs(x) > 0.98 || Math.abs(y) > 0.98 || z > 1;
    };
    const isFirst = cloud.length > 0 && !old?.cloud.length;
    if (!this.isTouched && (isFirst || way.some(isOut) || cloud.some(isOut))) this.fit(isFirst ? 0.9 : 0.8);
  }

  private drop<M extends { group: THREE.Group; dispose(): void }>(models: Map<string, M>, name: string, model: M): void {
    this.scene.remove(model.group);
    model.dispose();
    models.delete(name);
  }

  private clear(): void {
    this.still.traverse((part) => {
      if (part instanceof THREE.LineSegments) {
        part.geometry.dispose();
        part.material.dispose();
      }
    });
    this.still.clear();
    for (const label of this.labels) label.dispose();
    this.labels = [];
    for (const [name, model] of this.models) this.drop(this.models, name, model);
    for (const [name, model] of this.tracked) this.drop(this.tracked, name, model);
  }

  private build(scene: Scene, ink: THREE.Color): void {
    this.clear();
    // A tracked camera is not drawn at its pose in the rig file; without targets the volume has no meaning.
    const cameras = scene.cameras.filter((c) => c.model && !store.trackedCameras.has(c.name)); // others have no pose
    const hasVolume = scene.targets.length > 0;
    const low = new THREE.Vector3(...scene.volume[0]);
    const high = new THREE.Vector3(...scene.volume[1]);
    const bounds = new THREE.Box3();
    if (hasVolume) bounds.set(low, high);
    for (const camera of cameras) bounds.expandByPoint(new THREE.Vector3(...camera.position));
    if (bounds.isEmpty()) bounds.set(new THREE.Vector3(-0.2, -0.2, 0), new THREE.Vector3(0.2, 0.2, 0.2));
    this.reach = Math.max(bounds.getSize(new THREE.Vector3()).length() * 0.46, 0.2);
    this.extent = hasVolume ? cornersOf(new THREE.Box3(low, high)) : [];

    const size = high.clone().sub(low);
    if (hasVolume) {
      const box = new THREE.LineSegments(
        new THREE.EdgesGeometry(new THREE.BoxGeometry(size.x, size.y, size.z)),
        new THREE.LineBasicMaterial({ color: ink, transparent: true, opacity: 0.6 }),
      );
      box.position.copy(low).add(high).multiplyScalar(0.5);
      const cell = size.x > 8 ? 1 : size.x > 1.5 ? 0.25 : 0.1; // m
      const grid: THREE.Vector3[] = [];
      for (let x = Math.ceil(low.x / cell) * cell; x <= high.x + 1e-9; x += cell)
        grid.push(new THREE.Vector3(x, low.y, low.z), new THREE.Vector3(x, high.y, low.z));
      for (let y = Math.ceil(low.y / cell) * cell; y <= high.y + 1e-9; y += cell)
        grid.push(new THREE.Vector3(low.x, y, low.z), new THREE.Vector3(high.x, y, low.z));
      this.still.add(box, segments(grid, new THREE.LineBasicMaterial({ color: ink, transparent: true, opacity: 0.25 })));
    }
    const arm = hasVolume ? Math.min(size.x, size.y, size.z) / 5 : this.reach / 3;
    const isEmpty = !hasVolume && !cameras.length && store.trackedCameras.size === 0; // then there is no world frame
    (isEmpty ? [] : ["x", "y", "z"]).forEach((name, i) => {
      const end = new THREE.Vector3().setComponent(i, arm);
      this.still.add(segments([new THREE.Vector3(), end], new THREE.LineBasicMaterial({ color: ink })));
      this.extent.push(end);
      this.addLabel(name, end);
    });
    const depth = this.reach * 0.2;
    for (const camera of cameras) {
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
      this.still.add(segments(lines, new THREE.LineBasicMaterial({ color: ink })));
      this.extent.push(eye, ...rim);
      this.addLabel(camera.name, eye);
    }
  }

  private addLabel(text: string, at: THREE.Vector3): void {
    const label = new Label(text);
    label.sprite.position.copy(at);
    this.labels.push(label);
    this.still.add(label.sprite);
  }
}

function segments(points: THREE.Vector3[], material: THREE.LineBasicMaterial): THREE.LineSegments {
  return new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), material);
}

function cornersOf(box: THREE.Box3): THREE.Vector3[] {
  return [0, 1, 2, 3, 4, 5, 6, 7].map(
    (i) => new THREE.Vector3(i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z),
  );
}
