// Simulates how an eye adapts: crowded light is dimmed until its brightest places can be distinguished, sparse light
// stays as it is. It uses a sample of the points, so that every renderer gets the same result.
import { View } from "./camera";
import { PointStore } from "./point_store";
import { Sweep, lightOf } from "./renderer";

const kColumns = 64;
const kSamples = 30_000;
const kBright = 0.97; // the lit place at this quantile of light gets
const kWanted = 0.8; // this brightness

export class Adaptation {
  private readonly cells = new Float32Array(kColumns * kColumns);
  private readonly sorted: number[] = [];

  // Returns a factor of light, at most 1. `view` is for places in steps; `area(w)` is how many picture elements a point
  // covers at depth w.
  factor(store: PointStore, view: View, sweep: Sweep, width: number, height: number, area: (w: number) => number, cue: (w: number) => number): number {
    const total = store.points();
    if (total === 0) return 1;
    this.cells.fill(0);
    const stride = Math.max(1, Math.floor(total / kSamples));
    const half = Math.min(width, height) / 2;
    const cellArea = (width / kColumns) * (height / kColumns);
    for (let i = 0; i < store.slices.length; ++i) {
      const { count, x, y, z, rgb } = store.slices[i]!;
      const light = count > 0 ? (lightOf(sweep, i, store.slices.length) * stride) / (255 * cellArea) : 0;
      if (light <= 0) continue;
      for (let n = i % stride; n < count; n += stride) {
        const w = view[8]! * x[n]! + view[9]! * y[n]! + view[10]! * z[n]! + view[11]!;
        if (w <= 1e-6) continue;
        const column = Math.floor(((width / 2 + (half * (view[0]! * x[n]! + view[1]! * y[n]! + view[2]! * z[n]! + view[3]!)) / w) / width) * kColumns);
        const row = Math.floor(((height / 2 - (half * (view[4]! * x[n]! + view[5]! * y[n]! + view[6]! * z[n]! + view[7]!)) / w) / height) * kColumns);
        if (column < 0 || row < 0 || column >= kColumns || row >= kColumns) continue;
        const at = row * kColumns + column;
        this.cells[at] = this.cells[at]! + Math.max(rgb[n * 3]!, rgb[n * 3 + 1]!, rgb[n * 3 + 2]!) * light * area(w) * cue(w);
      }
    }
    this.sorted.length = 0;
    for (const cell of this.cells) if (cell > 0) this.sorted.push(cell);
    if (this.sorted.length === 0) return 1;
    this.sorted.sort((a, b) => a - b);
    const bright = this.sorted[Math.floor((this.sorted.length - 1) * kBright)]!;
    return Math.min(1, kWanted / bright);
  }
}
