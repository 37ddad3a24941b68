// The camera: an orbit around a point, +z upright. Lengths are in millimetres.

export interface Orbit {
  azimuth: number; // degrees, counter-clockwise seen from above; 0 is in front, towards −y
  elevation: number; // degrees, −89 to 89
  distance: number; // in radii of the volume
  target: [number, number, number];
}

// Rows of 4: x and y of the picture and depth, before the division, of a point in millimetres. The picture's centre is
// 0, y points up, and 1 is half of the picture's shorter side.
export type View = Float64Array;

const kFieldOfView = 30; // degrees, along the picture's shorter side

export const kHome: Orbit = { azimuth: 24, elevation: 20, distance: 1, target: [0, 0, 0] };

export function viewOf(orbit: Orbit, middle: readonly number[], radius: number): View {
  const a = (orbit.azimuth * Math.PI) / 180;
  const e = (orbit.elevation * Math.PI) / 180;
  const right = [Math.cos(a), Math.sin(a), 0];
  const away = [-Math.sin(a) * Math.cos(e), Math.cos(a) * Math.cos(e), -Math.sin(e)];
  const up = [-Math.sin(a) * Math.sin(e), Math.cos(a) * Math.sin(e), Math.cos(e)];
  const focal = 1 / Math.tan((kFieldOfView * Math.PI) / 360);
  const distance = (radius / Math.sin((kFieldOfView * Math.PI) / 360)) * 1.08 * orbit.distance;
  const at = [0, 1, 2].map((i) => middle[i]! + orbit.target[i as 0 | 1 | 2]);
  const dot = (v: number[]) => v[0]! * at[0]! + v[1]! * at[1]! + v[2]! * at[2]!;
  return new Float64Array([
    ...right.map((v) => v * focal), -dot(right) * focal,
    ...up.map((v) => v * focal), -dot(up) * focal,
    ...away, distance - dot(away),
  ]);
}

export interface Sphere { middle: number[]; radius: number }

// Returns the sphere that a camera looks at.
export function sphereOf(low: readonly number[], high: readonly number[]): Sphere {
  return {
    middle: low.map((each, i) => (each + high[i]!) / 2),
    radius: Math.hypot(...low.map((each, i) => (high[i]! - each) / 2)),
  };
}

// Returns the same view for points in steps of a box.
export function inSteps(view: View, low: readonly number[], high: readonly number[], steps: number): View {
  const out = new Float64Array(12);
  for (let row = 0; row < 3; ++row) {
    let shift = view[row * 4 + 3]!;
    for (let i = 0; i < 3; ++i) {
      out[row * 4 + i] = (view[row * 4 + i]! * (high[i]! - low[i]!)) / steps;
      shift += view[row * 4 + i]! * low[i]!;
    }
    out[row * 4 + 3] = shift;
  }
  return out;
}

// Returns picture elements from the left and the top, and depth in millimetres.
export function project(view: View, x: number, y: number, z: number, width: number, height: number): [number, number, number] {
  const w = view[8]! * x + view[9]! * y + view[10]! * z + view[11]!;
  const half = Math.min(width, height) / 2;
  return [
    width / 2 + (half * (view[0]! * x + view[1]! * y + view[2]! * z + view[3]!)) / w,
    height / 2 - (half * (view[4]! * x + view[5]! * y + view[6]! * z + view[7]!)) / w,
    w,
  ];
}
