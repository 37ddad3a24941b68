// Draws the volume without a GPU: every point adds its light to a small square of picture elements. Squares of the same
// side are recorded as single elements, and the running sums of these over that side, along rows and columns, are the
// picture. So a point costs three additions, whatever the size of its square. All arithmetic is in integers, so the
// result is the same as square by square.
import { View } from "./camera";
import { PointStore } from "./point_store";
import { Adaptation } from "./adaptation";
import { Sweep, depthCue, kFarLight, lightOf, sideOf, tone } from "./renderer";

export const kLargest = 24; // side of a square
const kUnit = 16384; // the full light of one pixel
export const kFocal = 1 / Math.tan(Math.PI / 12); // see camera.ts

export interface SplatScene {
  view: View; // for places in steps
  pitch: number; // of the display's pixels, in the view's units (mm)
  near: number; // depths of the volume's nearest and farthest point
  far: number;
  exposure: number;
  sweep: Sweep;
}

export class Splat {
  private light: Int32Array = new Int32Array(0);
  private readonly put: (Int32Array | null)[] = []; // by side: where squares begin
  private readonly rows: [number, number][] = []; // for each of them, the first and the last row that has any
  private sums = new Int32Array(0); // of the columns of a row
  private picture = new Uint8ClampedArray(0);
  private readonly adaptation = new Adaptation();
  width = 0;
  height = 0;

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    this.light = new Int32Array(width * height * 3);
    this.sums = new Int32Array(width * 3);
    this.put.length = this.rows.length = 0;
    this.picture = new Uint8ClampedArray(width * height * 4);
  }

  // Returns how many points there were. The picture is this.pixels().
  draw(store: PointStore, dark: PointStore | null, scene: SplatScene): number {
    this.light.fill(0);
    let points = 0;
    const focal = (Math.min(this.width, this.height) / 2) * scene.pitch * kFocal;
    const adapted = scene.exposure * this.adaptation.factor(store, scene.view, scene.sweep, this.width, this.height,
      (w) => sideOf(focal, w, kLargest) ** 2, (w) => depthCue((w - scene.near) / (scene.far - scene.near)));
    if (dark !== null) this.add(dark, 0, 1, scene, [0.05, 0.06, 0.09]);
    for (let i = 0; i < store.slices.length; ++i) {
      const slice = store.slices[i]!;
      const light = slice.count > 0 ? lightOf(scene.sweep, i, store.slices.length) : 0;
      if (light <= 0) continue;
      this.add(store, i, light * adapted, scene, null);
      points += slice.count;
    }
    this.spread();
    this.develop();
    return points;
  }

  pixels(): Uint8ClampedArray {
    return this.picture;
  }

  private add(store: PointStore, index: number, amount: number, scene: SplatScene, color: number[] | null): void {
    const { count, x, y, z, rgb } = store.slices[index]!;
    const [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11] = scene.view as unknown as
      [number, number, number, number, number, number, number, number, number, number, number, number];
    const { width, height, put } = this;
    const half = Math.min(width, height) / 2;
    const focal = half * scene.pitch * kFocal;
    const depth = 1 / Math.max(1e-9, scene.far - scene.near);
    const far = scene.far;
    const scale = color === null ? (amount * kUnit) / 255 : amount * kUnit;
    // In picture elements, before the division.
    const [x0, x1, x2, x3] = [m0 * half, m1 * half, m2 * half, m3 * half];
    const [y0, y1, y2, y3] = [m4 * half, m5 * half, m6 * half, m7 * half];
    let lastSide = 0;
    let light: Int32Array = this.light;
    let middleX = 0;
    let middleY = 0;
    let rightmost = 0;
    let lowest = 0;
    let first = height;
    let last = -1;
    for (let i = 0; i < count; ++i) {
      const px = x[i]!;
      const py = y[i]!;
      const pz = z[i]!;
      const w = m8 * px + m9 * py + m10 * pz + m11;
      if (w <= 1e-6) continue;
      const inverse = 1 / w;
      let side = 1;
      if (color === null) {
        side = (focal * inverse + 0.5) | 0;
        side = side < 1 ? 1 : side > kLargest ? kLargest : side;
      }
      if (side !== lastSide) {
        if (last >= 0) this.widen(lastSide, first, last);
        first = height;
        last = -1;
        lastSide = side;
        light = put[side] ?? (put[side] = new Int32Array(width * height * 3));
        middleX = (width - side + 1) / 2;
        middleY = (height - side + 1) / 2;
        rightmost = width - side;
        lowest = height - side;
      }
      const fromLeft = middleX + (x0 * px + x1 * py + x2 * pz + x3) * inverse;
      const fromTop = middleY - (y0 * px + y1 * py + y2 * pz + y3) * inverse;
      if (!(fromLeft >= 0 && fromTop >= 0)) continue;
      const left = fromLeft | 0;
      const top = fromTop | 0;
      if (left > rightmost || top > lowest) continue;
      if (top < first) first = top;
      if (top > last) last = top;
      let close = (far - w) * depth;
      close = close < 0 ? 0 : close > 1 ? 1 : close;
      const s = scale * (kFarLight + (1 - kFarLight) * close * close); // as depthCue
      const at = (top * width + left) * 3;
      if (color === null) {
        const from = i * 3;
        light[at] = light[at]! + ((rgb[from]! * s) | 0);
        light[at + 1] = light[at + 1]! + ((rgb[from + 1]! * s) | 0);
        light[at + 2] = light[at + 2]! + ((rgb[from + 2]! * s) | 0);
      } else {
        light[at] = light[at]! + color[0]! * s;
        light[at + 1] = light[at + 1]! + color[1]! * s;
        light[at + 2] = light[at + 2]! + color[2]! * s;
      }
    }
    if (last >= 0) this.widen(lastSide, first, last);
  }

  private widen(side: number, first: number, last: number): void {
    const range = this.rows[side] ?? (this.rows[side] = [this.height, -1]);
    range[0] = Math.min(range[0], first);
    range[1] = Math.max(range[1], last);
  }

  // Adds the sums of the recorded squares to the light, side by side, and clears the records.
  private spread(): void {
    const { light, put, rows, sums } = this;
    const wide = this.width * 3;
    for (let side = 1; side <= kLargest; ++side) {
      const from = put[side];
      const range = rows[side];
      if (from === undefined || from === null || range === undefined || range[1] < 0) continue;
      const reach = side * 3;
      const last = Math.min(this.height - 1, range[1] + side - 1);
      for (let row = range[0]; row <= range[1] && side > 1; ++row) {
        const start = row * wide;
        for (let channel = 0; channel < 3; ++channel) {
          let sum = 0;
          for (let at = wide - 3 + channel, n = 0; n < side; ++n, at -= 3) sum += from[start + at]!;
          for (let at = start + wide - 3 + channel; at >= start; at -= 3) {
            const before = from[at]!;
            from[at] = sum;
            sum -= before;
            if (at - reach >= start) sum += from[at - reach]!;
          }
        }
      }
      sums.fill(0);
      for (let row = range[0]; row <= last; ++row) {
        const start = row * wide;
        const gone = row - side >= range[0] ? (row - side) * wide : -1;
        for (let i = 0; i < wide; ++i) {
          let sum = sums[i]!;
          if (row <= range[1]) sum += from[start + i]!;
          if (gone >= 0) sum -= from[gone + i]!;
          sums[i] = sum;
          if (sum !== 0) light[start + i] = light[start + i]! + sum;
        }
      }
      from.fill(0, range[0] * wide, (range[1] + 1) * wide);
      range[0] = this.height;
      range[1] = -1;
    }
  }

  private develop(): void {
    const { light, picture } = this;
    for (let from = 0, to = 0; to < picture.length; from += 3, to += 4) {
      const r = light[from]!;
      const g = light[from + 1]!;
      const b = light[from + 2]!;
      const most = r > g ? (r > b ? r : b) : g > b ? g : b;
      if (most === 0) {
        picture[to] = picture[to + 1] = picture[to + 2] = picture[to + 3] = 0;
        continue;
      }
      const scale = (255 / kUnit) * tone(most / kUnit);
      picture[to] = r * scale;
      picture[to + 1] = g * scale;
      picture[to + 2] = b * scale;
      picture[to + 3] = 255;
    }
  }
}
