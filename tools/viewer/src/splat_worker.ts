// The splat's thread: it holds the volume, and draws into the page's canvas.
import { Orbit, inSteps, project, sphereOf, viewOf } from "./camera";
import { PointStore } from "./point_store";
import { Points, Watching, kDark, kPlaceSteps, readPoints } from "./protocol";
import { Scene, wholeSweep } from "./renderer";
import { Splat } from "./splat";

export type ToWorker =
  | { canvas: OffscreenCanvas }
  | { watching: Watching }
  | { message: ArrayBuffer }
  | { size: [number, number] }
  | { scene: Scene }
  | { trial: number };

const splat = new Splat();
let context: OffscreenCanvasRenderingContext2D | null = null;
let watching: Watching | null = null;
let store = new PointStore(0);
let dark: PointStore | null = null;
let image: ImageData | null = null;

function draw(where: Watching, scene: Scene): void {
  const began = performance.now();
  const { low_mm, high_mm } = where.around ?? where;
  const { middle, radius } = sphereOf(low_mm, high_mm);
  const view = viewOf(scene.orbit, middle, radius);
  const centre = project(view, middle[0]!, middle[1]!, middle[2]!, 1, 1)[2];
  const points = splat.draw(store, scene.dark ? dark : null, {
    view: inSteps(view, where.low_mm, where.high_mm, kPlaceSteps),
    pitch: where.pitch_mm,
    near: centre - radius,
    far: centre + radius,
    exposure: scene.exposure,
    sweep: scene.sweep,
  });
  if (context !== null && image !== null) {
    image.data.set(splat.pixels());
    context.putImageData(image, 0, 0);
  }
  postMessage({ drawn: { volume: store.volume, points, milliseconds: performance.now() - began } });
}

// Measures how long a picture of that many randomly placed points takes.
function trial(count: number): number {
  const points: Points = {
    kind: 1, whole: true, watch: 0, volume: 0,
    slices: new Uint32Array([0, count]),
    x: new Uint16Array(count), y: new Uint16Array(count), z: new Uint16Array(count),
    rgb: new Uint8Array(count * 3).fill(128),
  };
  for (let i = 0; i < count; ++i) {
    points.x[i] = (i * 40503) & 0xffff;
    points.y[i] = (i * 30011) & 0xffff;
    points.z[i] = (i * 20011) & 0xffff;
  }
  const tried = new PointStore(1);
  tried.update(points);
  const low = [-1, -1, -1];
  const high = [1, 1, 1];
  const orbit: Orbit = { azimuth: 24, elevation: 20, distance: 1, target: [0, 0, 0] };
  const view = inSteps(viewOf(orbit, [0, 0, 0], 1.7), low, high, kPlaceSteps);
  const scene = { view, pitch: 0.015, near: 4, far: 8, exposure: 1, sweep: wholeSweep(1) };
  let least = Infinity;
  for (let turn = 0; turn < 3; ++turn) {
    const began = performance.now();
    splat.draw(tried, null, scene);
    least = Math.min(least, performance.now() - began);
  }
  return least;
}

onmessage = (event: MessageEvent<ToWorker>) => {
  const what = event.data;
  if ("canvas" in what) {
    context = what.canvas.getContext("2d");
  } else if ("watching" in what) {
    watching = what.watching;
    store = new PointStore(watching.display.layout.slices);
    dark = null;
  } else if ("message" in what) {
    const points = readPoints(what.message);
    if (points.kind === kDark) {
      dark = new PointStore(1);
      dark.update({ ...points, slices: new Uint32Array([0, points.x.length]) });
    } else {
      store.update(points);
    }
  } else if ("size" in what) {
    const [width, height] = what.size;
    splat.resize(width, height);
    image = new ImageData(width, height);
    if (context !== null) {
      context.canvas.width = width;
      context.canvas.height = height;
    }
  } else if ("trial" in what) {
    splat.resize(960, 600);
    postMessage({ trial: trial(what.trial) });
  } else if (watching !== null && splat.width > 0) {
    draw(watching, what.scene);
  }
};
