// Draws the surroundings of the light: the display's box or cylinder, its axes, and a scale. The page draws them over
// the renderer's picture.
import { View, project } from "./camera";
import { DisplayDescription, Watching } from "./protocol";

type Line = [number, number, number, number, number, number];

const kRing = 96;

function box(low: readonly number[], high: readonly number[]): Line[] {
  const lines: Line[] = [];
  const at = (i: number) => [i & 1 ? high[0]! : low[0]!, i & 2 ? high[1]! : low[1]!, i & 4 ? high[2]! : low[2]!];
  for (let i = 0; i < 8; ++i) {
    for (const bit of [1, 2, 4]) if ((i & bit) === 0) lines.push([...at(i), ...at(i | bit)] as Line);
  }
  return lines;
}

function cylinder(radius: number, low: number, high: number): Line[] {
  const lines: Line[] = [];
  const at = (i: number, z: number) => [radius * Math.cos((i * 2 * Math.PI) / kRing), radius * Math.sin((i * 2 * Math.PI) / kRing), z];
  for (let i = 0; i < kRing; ++i) {
    lines.push([...at(i, low), ...at(i + 1, low)] as Line, [...at(i, high), ...at(i + 1, high)] as Line);
    if (i % (kRing / 8) === 0) lines.push([...at(i, low), ...at(i, high)] as Line);
  }
  return lines;
}

// Returns the outline of the display's volume, and below it the housing that turns or moves the light: a rotor's axle
// and base, a stack's frame.
export function outlineOf(display: DisplayDescription): Line[] {
  const { grid } = display.geometry;
  const low = [grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z];
  const high = [low[0]! + grid.nx * grid.pitch_mm.x, low[1]! + grid.ny * grid.pitch_mm.y, low[2]! + grid.nz * grid.pitch_mm.z];
  const depth = (high[2]! - low[2]!) * 0.08;
  if (display.geometry.rotor !== undefined || display.geometry.helix !== undefined) {
    const radius = Math.min(high[0]! - low[0]!, high[1]! - low[1]!) / 2;
    return [
      ...cylinder(radius, low[2]!, high[2]!),
      ...cylinder(radius * 0.6, low[2]! - depth, low[2]! - depth * 0.2).filter((_, i) => i % 2 === 0),
      [0, 0, low[2]! - depth, 0, 0, low[2]!],
    ];
  }
  return box(low, high);
}

// Returns a round length of about a fourth of the extent, in mm.
export function scaleOf(extent: number): number {
  const about = extent / 4;
  const power = Math.pow(10, Math.floor(Math.log10(about)));
  return [1, 2, 5, 10].map((n) => n * power).reduce((best, n) => (Math.abs(n - about) < Math.abs(best - about) ? n : best));
}

export interface OutlineColors { line: string; text: string; axes: [string, string, string] }

export function drawOutline(context: CanvasRenderingContext2D, view: View, watching: Watching, width: number, height: number, colors: OutlineColors): void {
  context.clearRect(0, 0, width, height);
  const line = (a: number[], b: number[]) => {
    const [x0, y0, w0] = project(view, a[0]!, a[1]!, a[2]!, width, height);
    const [x1, y1, w1] = project(view, b[0]!, b[1]!, b[2]!, width, height);
    if (w0 <= 0 || w1 <= 0) return null;
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    return [x1, y1] as const;
  };
  context.lineWidth = 1;
  context.strokeStyle = colors.line;
  context.beginPath();
  for (const l of outlineOf(watching.display)) line(l.slice(0, 3), l.slice(3));
  context.stroke();

  const low = watching.low_mm;
  const extent = Math.max(...watching.high_mm.map((high, i) => high - low[i]!));
  const length = scaleOf(extent);
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  (["x", "y", "z"] as const).forEach((name, axis) => {
    const to = [...low];
    to[axis] = to[axis]! + length;
    context.strokeStyle = context.fillStyle = colors.axes[axis]!;
    context.lineWidth = 2;
    context.beginPath();
    const end = line(low, to);
    context.stroke();
    to[axis] = to[axis]! + length * 0.12;
    const [x, y, w] = project(view, to[0]!, to[1]!, to[2]!, width, height);
    if (end !== null && w > 0) context.fillText(name, x, y);
  });
  context.fillStyle = colors.text;
  context.textAlign = "left";
  context.fillText(`axes: ${Number(length.toPrecision(3))} mm`, 12, height - 14);
}
