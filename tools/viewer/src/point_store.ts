// The rebuilt volume: the lit pixels of each slice, as last received. A slice is overwritten in place, so memory grows
// with the greatest number of lit pixels and not with the number of changes.
import { Points } from "./protocol";
import { Sweep, lightOf } from "./renderer";

export interface Slice {
  count: number;
  x: Uint16Array;
  y: Uint16Array;
  z: Uint16Array;
  rgb: Uint8Array;
  changed: number; // the number of the update that last changed it
}

export class PointStore {
  readonly slices: Slice[] = [];
  updates = 0;
  volume = 0;

  constructor(count: number) {
    for (let i = 0; i < count; ++i) {
      this.slices.push({ count: 0, x: new Uint16Array(0), y: new Uint16Array(0), z: new Uint16Array(0), rgb: new Uint8Array(0), changed: 0 });
    }
  }

  // Returns the slices that were received.
  update(points: Points): number[] {
    ++this.updates;
    this.volume = points.volume;
    const came: number[] = [];
    let from = 0;
    for (let i = 0; i < points.slices.length; i += 2) {
      const slice = this.slices[points.slices[i]!];
      const count = points.slices[i + 1]!;
      const to = from + count;
      if (slice !== undefined) {
        if (slice.x.length < count) {
          const room = Math.ceil(count * 1.25);
          slice.x = new Uint16Array(room);
          slice.y = new Uint16Array(room);
          slice.z = new Uint16Array(room);
          slice.rgb = new Uint8Array(room * 3);
        }
        slice.x.set(points.x.subarray(from, to));
        slice.y.set(points.y.subarray(from, to));
        slice.z.set(points.z.subarray(from, to));
        slice.rgb.set(points.rgb.subarray(from * 3, to * 3));
        slice.count = count;
        slice.changed = this.updates;
        came.push(points.slices[i]!);
      }
      from = to;
    }
    return came;
  }

  // Returns the number of points of the slices that give light.
  lit(sweep: Sweep): number {
    return this.slices.reduce((sum, slice, i) => sum + (lightOf(sweep, i, this.slices.length) > 0 ? slice.count : 0), 0);
  }

  points(): number {
    return this.slices.reduce((sum, slice) => sum + slice.count, 0);
  }
}
