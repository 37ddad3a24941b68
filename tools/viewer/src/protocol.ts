// The messages between the page and the daemon: docs/protocols/viewer.md.

export interface Vec3 { x: number; y: number; z: number }

export interface Geometry {
  planar_stack?: { width_px: number; height_px: number; positions_mm: number[]; normal?: string };
  rotor?: { slices_per_turn: number; width_px: number; height_px: number; panels: unknown[] };
  helix?: { slices_per_turn: number; width_px: number; height_px: number };
  lattice?: { width_px: number; slices: number };
  grid: { nx: number; ny: number; nz: number; pitch_mm: Vec3; origin_mm: Vec3 };
}

export interface DisplayDescription {
  name: string;
  driver: string;
  state: string;
  state_reason: string;
  geometry: Geometry;
  layout: { slices: number; width: number; height: number; sub_frames: number; format: string };
  volumes_per_second: number;
  brightness: number;
  blank: boolean;
  test_pattern: string;
}

export interface Latency { count: string; p50_ns: string; p99_ns: string; max_ns: string }

export interface DisplayStats {
  name: string;
  state: string;
  state_reason: string;
  engine: string;
  engine_device: string;
  engine_reason: string;
  engine_degraded: string;
  lit_voxels: string;
  volumes_per_second: number;
  volumes_presented: string;
  volumes_lost: string;
  bytes_out: string;
  commits_superseded: string;
  commits_lost: string;
  commits_presented: string;
  [stage: string]: unknown;
}

export interface Stats {
  time_ns: string;
  version: string;
  uptime_ns: string;
  sessions: string;
  owners: string;
  layers: string;
  entities: string;
  bytes_in: string;
  commits_refused: string;
  displays: DisplayStats[];
  [stage: string]: unknown;
}

export interface LayerInfo {
  owner: string;
  layer: string;
  visible: boolean;
  opacity: number;
  order: number;
  entities: string;
  orphaned: boolean;
  client_name: string;
}

// The space of a watch's places: place q of an axis is low + q / kPlaceSteps · (high − low).
export interface Watching {
  id: number;
  low_mm: [number, number, number];
  high_mm: [number, number, number];
  pitch_mm: number;
  display: DisplayDescription;
  // The camera's target; otherwise all places.
  around?: { low_mm: [number, number, number]; high_mm: [number, number, number] };
}

// A comparison of what a display shows with what was sent to it, or the reason for its absence.
export interface Compared {
  id: number;
  why?: string;
  volume: string;
  low_mm: [number, number, number];
  high_mm: [number, number, number];
  pitch_mm: number;
  voxels: number;
  missing: number;
  pixels: number;
  stray: number;
  off: number;
  mean: number;
  most: number;
}

export interface Hello { version: string; control: boolean; displays: DisplayDescription[] }

// The state of playing files, sent to pages with control. `why_not` is why no files are accepted.
export interface Play { max_bytes?: number; playing?: string; failed?: string; why?: string; why_not?: string }

export type FromDaemon = {
  hello?: Hello;
  watching?: Watching;
  ended?: { id: number; why: string };
  stats?: Stats;
  layers?: { layers: LayerInfo[]; total: string };
  display?: DisplayDescription;
  compared?: Compared;
  play?: Play;
  error?: string;
};

export const kPlaceSteps = 65534;
export const kVolume = 1;
export const kDark = 2;
export const kSent = 3;
export const kDifference = 4;
const kHeaderBytes = 24;

// A binary message, as views of its bytes: slice slices[2·i] has slices[2·i + 1] points, which are stored in sequence.
export interface Points {
  kind: number;
  whole: boolean;
  watch: number;
  volume: number;
  slices: Uint32Array;
  x: Uint16Array;
  y: Uint16Array;
  z: Uint16Array;
  rgb: Uint8Array;
}

export function readPoints(bytes: ArrayBuffer): Points {
  const header = new DataView(bytes);
  const slices = header.getUint32(4, true);
  const n = header.getUint32(8, true);
  let at = kHeaderBytes;
  const next = (length: number) => (at += length) - length;
  return {
    kind: header.getUint8(0),
    whole: header.getUint8(1) !== 0,
    watch: header.getUint16(2, true),
    volume: Number(header.getBigUint64(16, true)),
    slices: new Uint32Array(bytes, next(slices * 8), slices * 2),
    x: new Uint16Array(bytes, next(n * 2), n),
    y: new Uint16Array(bytes, next(n * 2), n),
    z: new Uint16Array(bytes, next(n * 2), n),
    rgb: new Uint8Array(bytes, next(n * 3), n * 3),
  };
}
