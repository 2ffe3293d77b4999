// The events of the bridge; see clients/live_view/events.h. Times are UNIX seconds, lengths metres; null stands for NaN.
export type State = "searching" | "tracking" | "coasting" | "lost";
export type N = number | null;

export interface Position {
  target: string;
  t: number;
  set: number;
  state: State;
  position: [N, N, N];
  velocity: [N, N, N];
  covariance: N[];
  views: number;
  confidence: number;
  particles: number;
  ess: number;
  latency: number;
  tracking_latency: number; // of it, from the arrival of the pictures' last byte on
  per_view: { camera: string; delivered: boolean; seen: boolean; support: number; residual_px: number }[];
}

// The pose of a tracked camera.
export interface CameraPose {
  camera: string;
  t: number;
  state: State;
  position: [N, N, N];
  orientation: [N, N, N, N]; // x y z w: camera axes to the world's
  sigma: [N, N, N];
  covariance: N[]; // of position (m) and rotation (rad), 6x6
  features_in_view: number;
  features_matched: number;
  map_points: number;
  confidence: number;
  latency: number;
  tracking_latency: number;
}

export interface CameraMapPoint {
  id: number;
  position: [N, N, N];
  covariance: [N, N, N, N, N, N]; // xx xy xz yy yz zz
  state: "not_sought" | "missed" | "found";
  given: boolean; // by the start, not mapped
}

export interface CameraMap {
  camera: string;
  host: string;
  pid: number;
  t: number;
  map_points: number; // total; points may be fewer
  points: CameraMapPoint[];
}

export interface CameraStatus {
  name: string;
  health: "waiting" | "delivering" | "stalled" | "absent" | "ended" | "unknown";
  message: string;
  frames: number;
  dropped: number;
  corrupted: number;
  rate_hz: number;
  age_s: number;
}

export interface Status {
  host: string;
  pid: number;
  heard: number;
  version: string;
  mode: string;
  config_file: string;
  config_identity: string;
  rig_identity: string;
  rig_history: string;
  set_rate_hz: number;
  sets: number;
  incomplete_sets: number;
  late_frames: number;
  dropped_sets: number;
  published: number;
  publish_failures: number;
  cameras: CameraStatus[];
  targets: string[];
  warnings: string[];
}

export interface CameraTimes {
  host: string;
  pid: number;
  cameras: { name: string; latency_s: number; latency_sigma_s: number; readout_s: number; readout_sigma_s: number }[];
}

// The clocks of remote cameras' hosts.
export interface HostClocks {
  host: string;
  pid: number;
  clocks: {
    host: string;
    cameras: string[];
    known: boolean;
    offset_s: number;
    sigma_s: number;
    drift_ppm: number;
    round_trip_s: number;
    same_machine: boolean;
    kept_s: N;
    contradicted: boolean;
    advice: string;
  }[];
}

export interface Color {
  camera: string;
  hue_deg: [number, number];
  saturation: [number, number];
  intensity: [number, number];
}

export interface Ignore {
  camera: string;
  box: [number, number, number, number];
}

export interface SceneCamera {
  name: string;
  size: [number, number];
  model: string; // empty: not calibrated; the following fields are then invalid
  intrinsics: number[];
  position: [number, number, number];
  orientation: [number, number, number, number];
  border: N[];
}

export interface Scene {
  host: string;
  pid: number;
  at: number;
  rig_identity: string;
  frame_id: string;
  volume: [[number, number, number], [number, number, number]];
  cameras: SceneCamera[];
  targets: { name: string; radius: number; rgb: [number, number, number]; colors: Color[] }[]; // no colors: not taught yet
  ignored: Ignore[];
  may_teach: boolean;
  why_not: string;
}

export interface Preview {
  camera: string;
  t: number;
  set: number;
  image: [number, number];
  size: [number, number];
  jpeg: string;
  // left_out: a static patch; particles are u_min v_min u_max v_max
  targets: { target: string; state: State | "left_out"; px: [N, N]; radius: N; ellipse: [N, N, N]; particles: N[] }[];
}

export interface Pulse {
  now: number;
  domain: number;
  bus: string;
  publishers: number;
  trouble: string;
}

export interface TaughtCamera {
  camera: string;
  pointed: boolean;
  region: [N, N];
  region_radius: N;
  color: Color;
  background_share: number;
  background_box: number[];
  verdict: string;
  size: [number, number];
  jpeg: string;
  mask: string;
}

// The reply to a request in words: idl/README.md.
export interface ControlReply {
  client: string;
  number: number;
  granted: boolean;
  reason: string;
  rows: string[][];
}

export interface TeachReply {
  client: string;
  number: number;
  granted: boolean;
  reason: string;
  set: number;
  radius: N;
  cameras: TaughtCamera[];
}
