// The interface of what draws the volume. There are two implementations: points with WebGL2 if there is a GPU, and
// otherwise a splat in a worker.
import { Orbit } from "./camera";
import { Watching } from "./protocol";

// Which slices give light, and how much: it simulates what an eye retains of a slowed-down sweep.
export interface Sweep {
  first: number; // the newest slice lit; later ones have faded
  length: number; // slices visible at once: all of them unless it is slowed down
  fades: boolean; // older ones are dimmer
}

export interface Scene {
  orbit: Orbit;
  exposure: number; // factor of light
  sweep: Sweep;
  dark: boolean; // pixels without light are shown too
}

export interface Drawn { volume: number; points: number; milliseconds: number }

export interface Renderer {
  readonly name: string;
  // Begins a watch and discards the previous contents.
  begin(watching: Watching): void;
  // Processes a binary message, and takes ownership of it.
  update(message: ArrayBuffer): void;
  resize(width: number, height: number, ratio: number): void;
  // Draws the scene immediately, or as soon as the previous drawing has finished; of the scenes that arrive meanwhile
  // only the newest is drawn. `drawn` is called for each one drawn.
  draw(scene: Scene): void;
  onDrawn: (drawn: Drawn) => void;
  dispose(): void;
}

export function wholeSweep(slices: number): Sweep {
  return { first: slices - 1, length: slices, fades: false };
}

// Returns the light of slice `i` of `slices`, 0 to 1.
export function lightOf(sweep: Sweep, i: number, slices: number): number {
  const age = (sweep.first - i + slices) % slices;
  if (age >= sweep.length) return 0;
  return sweep.fades ? 1 - age / sweep.length : 1;
}

// Returns the factor for a sum of light by its greatest channel: 1 is the full light of one pixel; anything brighter is
// shown at full light, in its own colour.
export function tone(greatest: number): number {
  return greatest > 1 ? 1 / greatest : 1;
}

// Returns the factor of a point's light for its distance, which is 0 at the volume's nearest place and 1 at its
// farthest. Dimming replaces the depth that two eyes would see.
export const kFarLight = 0.12;
export function depthCue(away: number): number {
  const near = 1 - Math.min(1, Math.max(0, away));
  return kFarLight + (1 - kFarLight) * near * near;
}

// Returns the side of a point's square at depth w, in picture elements.
export function sideOf(focal: number, w: number, largest: number): number {
  return Math.min(largest, Math.max(1, Math.floor(focal / w + 0.5)));
}
