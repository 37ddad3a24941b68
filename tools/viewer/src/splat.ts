// The volume as a picture without a GPU: every point adds its light to a small square of picture elements.
import { View } from "./camera";
import { PointStore } from "./point_store";
import { Adaptation } from "./adaptation";
import { Sweep, depthCue, kFarLight, lightOf, sideOf, tone } from "./renderer";

const kLargest = 7; // side of a square
export const kFocal = 1 / Math.tan(Math.PI / 12); // of camera.ts

export interface SplatScene {
  view: View; // of places in steps
  pitch: number; // of the display's pixels, in the view's units (mm)
  near: number; // depth of the volume's nearest and farthest point
  far: number;
  exposure: number;
  sweep: Sweep;
}

export class Splat {
  private light = new Float32Array(0);
  private picture = new Uint8ClampedArray(0);
  private readonly adaptation = new Adaptation();
  width = 0;
  height = 0;

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    this.light = new Float32Array(width * height * 3);
    this.picture = new Uint8ClampedArray(width * height * 4);
  }

  // Answers how many points there were. The picture is this.pixels().
  draw(store: PointStore, dark: PointStore | null, scene: SplatScene): number {
    this.light.fill(0);
    let points = 0;
    const focal = (Math.min(this.width, this.height) / 2) * scene.pitch * kFocal;
    const adapted = scene.exposure * this.adaptation.factor(store, scene.view, scene.sweep, this.width, this.height,
      (w) => sideOf(focal, w, kLargest) ** 2, (w) => depthCue((w - scene.near) / (scene.far - scene.near)));
    if (dark !== null) this.add(dark, 0, 0, scene, [0.05, 0.06, 0.09], 1);
    for (let i = 0; i < store.slices.length; ++i) {
      const slice = store.slices[i]!;
      const light = slice.count > 0 ? lightOf(scene.sweep, i, store.slices.length) : 0;
      if (light <= 0) continue;
      this.add(store, i, light * adapted, scene, null, 0);
      points += slice.count;
    }
    this.develop();
    return points;
  }

  pixels(): Uint8ClampedArray {
    return this.picture;
  }

  private add(store: PointStore, index: number, amount: number, scene: SplatScene, color: number[] | null, least: number): void {
    const { count, x, y, z, rgb } = store.slices[index]!;
    const m = scene.view;
    const [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11] = m as unknown as number[] as [number, number, number, number, number, number, number, number, number, number, number, number];
    const { width, height, light } = this;
    const half = Math.min(width, height) / 2;
    const middleX = width / 2;
    const middleY = height / 2;
    const focal = half * scene.pitch * kFocal;
    const depth = 1 / Math.max(1e-9, scene.far - scene.near);
    const scale = amount / 255;
    for (let i = 0; i < count; ++i) {
      const px = x[i]!;
      const py = y[i]!;
      const pz = z[i]!;
      const w = m8 * px + m9 * py + m10 * pz + m11;
      if (w <= 1e-6) continue;
      const inverse = 1 / w;
      const sx = middleX + half * (m0 * px + m1 * py + m2 * pz + m3) * inverse;
      const sy = middleY - half * (m4 * px + m5 * py + m6 * pz + m7) * inverse;
      let side = (focal * inverse + 0.5) | 0;
      side = side < 1 ? 1 : side > kLargest ? kLargest : side;
      if (least !== 0) side = 1;
      const left = Math.floor(sx - side / 2 + 0.5);
      const top = Math.floor(sy - side / 2 + 0.5);
      if (left < 0 || top < 0 || left + side > width || top + side > height) continue;
      let away = (w - scene.near) * depth;
      away = away < 0 ? 1 : away > 1 ? 0 : 1 - away;
      const cue = kFarLight + (1 - kFarLight) * away * away; // depthCue
      let r = 0;
      let g = 0;
      let b = 0;
      if (color === null) {
        const s = scale * cue;
        r = rgb[i * 3]! * s;
        g = rgb[i * 3 + 1]! * s;
        b = rgb[i * 3 + 2]! * s;
      } else {
        r = color[0]! * cue;
        g = color[1]! * cue;
        b = color[2]! * cue;
      }
      let row = (top * width + left) * 3;
      for (let v = 0; v < side; ++v, row += width * 3) {
        for (let at = row, end = row + side * 3; at < end; at += 3) {
          light[at] = light[at]! + r;
          light[at + 1] = light[at + 1]! + g;
          light[at + 2] = light[at + 2]! + b;
        }
      }
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
      const scale = 255 * tone(most);
      picture[to] = r * scale;
      picture[to + 1] = g * scale;
      picture[to + 2] = b * scale;
      picture[to + 3] = 255;
    }
  }
}
