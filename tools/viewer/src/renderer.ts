// What draws the volume. Two do: points by WebGL2 where there is a GPU, a splat in a worker where there is none.
import { Orbit } from "./camera";
import { Watching } from "./protocol";

// Which slices give light, and how much: what an eye keeps of a sweep that is slowed down.
export interface Sweep {
  first: number; // the newest slice lit; later ones have faded
  length: number; // slices seen at once: all of them, when it is not slowed down
  fades: boolean; // older ones are dimmer
}

export interface Scene {
  orbit: Orbit;
  exposure: number; // factor of light
  sweep: Sweep;
  dark: boolean; // pixels without light are shown, too
}

export interface Drawn { volume: number; points: number; milliseconds: number }

export interface Renderer {
  readonly name: string;
  // A watch has begun: what was there is gone.
  begin(watching: Watching): void;
  // A binary message, which is given away.
  update(message: ArrayBuffer): void;
  resize(width: number, height: number, ratio: number): void;
  // At once, or as soon as the last is done; what was asked meanwhile but for the newest is passed over. `drawn` is
  // called for each that was.
  draw(scene: Scene): void;
  onDrawn: (drawn: Drawn) => void;
  dispose(): void;
}

export function wholeSweep(slices: number): Sweep {
  return { first: slices - 1, length: slices, fades: false };
}

// The light of slice `i` of `slices`, 0 to 1.
export function lightOf(sweep: Sweep, i: number, slices: number): number {
  const age = (sweep.first - i + slices) % slices;
  if (age >= sweep.length) return 0;
  return sweep.fades ? 1 - age / sweep.length : 1;
}

// Sums of light by their greatest channel: 1 is the full light of one pixel; what is brighter shows as full, in its own colour.
export function tone(greatest: number): number {
  return greatest > 1 ? 1 / greatest : 1;
}

// How far away, 0 at the volume's nearest place and 1 at its farthest, dims: what a picture has in place of two eyes.
export const kFarLight = 0.12;
export function depthCue(away: number): number {
  const near = 1 - Math.min(1, Math.max(0, away));
  return kFarLight + (1 - kFarLight) * near * near;
}

// Of a point at depth w: the side of its square, in picture elements.
export function sideOf(focal: number, w: number, largest: number): number {
  return Math.min(largest, Math.max(1, Math.floor(focal / w + 0.5)));
}
