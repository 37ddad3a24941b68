// Draws points on a GPU: they are summed in a picture of half floats and then developed like the splat's.
import {
  AddEquation, BufferAttribute, BufferGeometry, Camera, CustomBlending, DynamicDrawUsage, GLSL3, HalfFloatType, Mesh, NearestFilter,
  NoBlending, OneFactor, Points as PointCloud, RawShaderMaterial, Scene as Stage, Vector2, Vector4, WebGLRenderer, WebGLRenderTarget,
} from "three";
import { View, inSteps, project, sphereOf, viewOf } from "./camera";
import { PointStore } from "./point_store";
import { Points, Watching, kDark, kPlaceSteps, readPoints } from "./protocol";
import { Adaptation } from "./adaptation";
import { Drawn, Renderer, Scene, depthCue, kFarLight, sideOf, wholeSweep } from "./renderer";
import { kFocal, kLargest } from "./splat";

const kMostChunks = 64;

const kVertex = `
precision highp float;
in vec3 position;
in vec3 color;
in float slice;
uniform vec4 rowX, rowY, rowW;
uniform vec2 aspect;
uniform float focal, near, depth, amount;
uniform float first, reach, fades, slices;
out vec3 light;
void main() {
  vec4 p = vec4(position, 1.0);
  float w = dot(rowW, p);
  float age = mod(first - slice + slices, slices);
  float share = age >= reach ? 0.0 : mix(1.0, 1.0 - age / reach, fades);
  float close = 1.0 - clamp((w - near) * depth, 0.0, 1.0);
  float cue = ${kFarLight} + (1.0 - ${kFarLight}) * close * close;
  light = color * (share * amount * cue);
  gl_Position = share <= 0.0 ? vec4(2.0, 2.0, 2.0, 1.0) : vec4(dot(rowX, p) * aspect.x, dot(rowY, p) * aspect.y, 0.0, w);
  gl_PointSize = clamp(floor(focal / w + 0.5), 1.0, ${kLargest}.0);
}`;

const kFragment = `
precision highp float;
in vec3 light;
out vec4 sum;
void main() { sum = vec4(light, 1.0); }`;

const kCover = `
precision highp float;
in vec3 position;
void main() { gl_Position = vec4(position, 1.0); }`;

const kDevelop = `
precision highp float;
uniform sampler2D sums;
out vec4 color;
void main() {
  vec4 s = texelFetch(sums, ivec2(gl_FragCoord.xy), 0);
  color = vec4(s.rgb / max(1.0, max(s.r, max(s.g, s.b))), s.a > 0.0 ? 1.0 : 0.0);
}`;

interface Chunk { cloud: PointCloud; room: number }

export class GlRenderer implements Renderer {
  readonly name = "WebGL2";
  onDrawn: (drawn: Drawn) => void = () => {};
  private readonly gl: WebGLRenderer;
  private readonly target: WebGLRenderTarget;
  private readonly stage = new Stage();
  private readonly developing = new Stage();
  private readonly camera = new Camera();
  private readonly adaptation = new Adaptation();
  private readonly material: RawShaderMaterial;
  private chunks: (Chunk | null)[] = [];
  private perChunk = 1;
  private store = new PointStore(0);
  private dark: PointCloud | null = null;
  private watching: Watching | null = null;
  private size = new Vector2(1, 1);
  private asked: Scene | null = null;

  // Throws if WebGL2 or pictures of half floats are not supported.
  constructor(canvas: HTMLCanvasElement) {
    this.gl = new WebGLRenderer({ canvas, alpha: true, antialias: false, premultipliedAlpha: false, powerPreference: "high-performance" });
    if (this.gl.getContext().getExtension("EXT_color_buffer_float") === null) {
      this.gl.dispose();
      this.gl.forceContextLoss();
      throw new Error("no half floats to draw into");
    }
    this.gl.autoClear = false;
    this.target = new WebGLRenderTarget(1, 1, { type: HalfFloatType, depthBuffer: false, magFilter: NearestFilter, minFilter: NearestFilter });
    this.material = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: kVertex, fragmentShader: kFragment, depthTest: false, depthWrite: false, transparent: true,
      blending: CustomBlending, blendEquation: AddEquation, blendSrc: OneFactor, blendDst: OneFactor,
      uniforms: {
        rowX: { value: new Vector4() }, rowY: { value: new Vector4() }, rowW: { value: new Vector4() }, aspect: { value: new Vector2() },
        focal: { value: 1 }, near: { value: 0 }, depth: { value: 1 }, amount: { value: 1 },
        first: { value: 0 }, reach: { value: 1 }, fades: { value: 0 }, slices: { value: 1 },
      },
    });
    const cover = new BufferGeometry();
    cover.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    const develop = new Mesh(cover, new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: kCover, fragmentShader: kDevelop, depthTest: false, depthWrite: false, blending: NoBlending,
      uniforms: { sums: { value: this.target.texture } },
    }));
    develop.frustumCulled = false;
    this.developing.add(develop);
  }

  begin(watching: Watching): void {
    this.watching = watching;
    this.clear();
    const slices = watching.display.layout.slices;
    this.store = new PointStore(slices);
    this.perChunk = Math.ceil(slices / kMostChunks);
    this.chunks = new Array<Chunk | null>(Math.ceil(slices / this.perChunk)).fill(null);
  }

  update(message: ArrayBuffer): void {
    const points = readPoints(message);
    if (points.kind === kDark) return this.setDark(points);
    const touched = new Set(this.store.update(points).map((slice) => Math.floor(slice / this.perChunk)));
    for (const chunk of touched) this.fill(chunk);
  }

  resize(width: number, height: number, ratio: number): void {
    this.gl.setPixelRatio(ratio);
    this.gl.setSize(width, height, false);
    this.gl.getDrawingBufferSize(this.size);
    this.target.setSize(this.size.x, this.size.y);
  }

  draw(scene: Scene): void {
    const waits = this.asked !== null;
    this.asked = scene;
    if (waits) return;
    requestAnimationFrame(() => {
      const asked = this.asked;
      this.asked = null;
      if (asked !== null && this.watching !== null) this.render(this.watching, asked);
    });
  }

  dispose(): void {
    this.asked = this.watching = null;
    this.clear();
    this.target.dispose();
    this.gl.dispose();
    this.gl.forceContextLoss();
  }

  // Returns the bytes of all buffers of points.
  gpuBytes(): number {
    const clouds = [...this.chunks.map((chunk) => chunk?.cloud), this.dark];
    return clouds.reduce((sum, cloud) => sum + Object.values(cloud?.geometry.attributes ?? {}).reduce((bytes, each) => bytes + each.array.byteLength, 0), 0);
  }

  // Returns the milliseconds for a picture of that many points, including all work of the GPU.
  static try(points: number): number {
    const canvas = document.createElement("canvas");
    let renderer: GlRenderer;
    try {
      renderer = new GlRenderer(canvas);
    } catch {
      return Infinity;
    }
    renderer.resize(960, 600, 1);
    const room = new ArrayBuffer(24 + 8 + points * 9);
    const header = new DataView(room);
    header.setUint8(0, 1);
    header.setUint32(4, 1, true);
    header.setUint32(8, points, true);
    header.setUint32(28, points, true);
    new Uint16Array(room, 32, points * 3).forEach((_, i, all) => (all[i] = (i * 40503) & 0xffff));
    new Uint8Array(room, 32 + points * 6).fill(128);
    const watching = { id: 0, low_mm: [-1, -1, -1], high_mm: [1, 1, 1], pitch_mm: 0.015, display: { layout: { slices: 1 } } } as unknown as Watching;
    renderer.begin(watching);
    renderer.update(room);
    let least = Infinity;
    for (let turn = 0; turn < 3; ++turn) {
      const began = performance.now();
      renderer.render(watching, { orbit: { azimuth: 24, elevation: 20, distance: 1, target: [0, 0, 0] }, exposure: 1, sweep: wholeSweep(1), dark: false });
      const gl = renderer.gl.getContext();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until the GPU has finished
      least = Math.min(least, performance.now() - began);
    }
    renderer.dispose();
    return least;
  }

  private clear(): void {
    for (const chunk of this.chunks) {
      if (chunk === null) continue;
      this.stage.remove(chunk.cloud);
      chunk.cloud.geometry.dispose();
    }
    this.chunks = [];
    if (this.dark !== null) {
      this.stage.remove(this.dark);
      this.dark.geometry.dispose();
      this.dark = null;
    }
  }

  private cloudOf(room: number): PointCloud {
    const geometry = new BufferGeometry();
    const attribute = (array: Uint16Array | Uint8Array, size: number, normalised: boolean) => {
      const made = new BufferAttribute(array, size, normalised);
      made.setUsage(DynamicDrawUsage);
      return made;
    };
    geometry.setAttribute("position", attribute(new Uint16Array(room * 3), 3, false));
    geometry.setAttribute("color", attribute(new Uint8Array(room * 3), 3, true));
    geometry.setAttribute("slice", attribute(new Uint16Array(room), 1, false));
    const cloud = new PointCloud(geometry, this.material);
    cloud.frustumCulled = false;
    this.stage.add(cloud);
    return cloud;
  }

  private fill(index: number): void {
    const from = index * this.perChunk;
    const slices = this.store.slices.slice(from, from + this.perChunk);
    const count = slices.reduce((sum, slice) => sum + slice.count, 0);
    let chunk = this.chunks[index] ?? null;
    if (chunk === null || chunk.room < count) {
      if (chunk !== null) {
        this.stage.remove(chunk.cloud);
        chunk.cloud.geometry.dispose();
      }
      const room = Math.ceil(count * 1.25) + 16;
      chunk = { cloud: this.cloudOf(room), room };
      this.chunks[index] = chunk;
    }
    const geometry = chunk.cloud.geometry;
    const position = geometry.getAttribute("position") as BufferAttribute;
    const color = geometry.getAttribute("color") as BufferAttribute;
    const number = geometry.getAttribute("slice") as BufferAttribute;
    let at = 0;
    slices.forEach((slice, i) => {
      for (let n = 0; n < slice.count; ++n, ++at) {
        position.array[at * 3] = slice.x[n]!;
        position.array[at * 3 + 1] = slice.y[n]!;
        position.array[at * 3 + 2] = slice.z[n]!;
      }
      (color.array as Uint8Array).set(slice.rgb.subarray(0, slice.count * 3), (at - slice.count) * 3);
      (number.array as Uint16Array).fill(from + i, at - slice.count, at);
    });
    for (const [attribute, size] of [[position, 3], [color, 3], [number, 1]] as const) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, count * size);
      attribute.needsUpdate = true;
    }
    geometry.setDrawRange(0, count);
  }

  private setDark(points: Points): void {
    if (this.dark !== null) {
      this.stage.remove(this.dark);
      this.dark.geometry.dispose();
    }
    const count = points.x.length;
    this.dark = this.cloudOf(count);
    const position = this.dark.geometry.getAttribute("position") as BufferAttribute;
    for (let n = 0; n < count; ++n) position.setXYZ(n, points.x[n]!, points.y[n]!, points.z[n]!);
    (this.dark.geometry.getAttribute("color") as BufferAttribute).array.forEach((_, i, all) => (all[i] = [13, 15, 23][i % 3]!));
    this.dark.geometry.setDrawRange(0, count);
  }

  private render(watching: Watching, scene: Scene): void {
    const began = performance.now();
    const { low_mm, high_mm } = watching.around ?? watching;
    const { middle, radius } = sphereOf(low_mm, high_mm);
    const view: View = viewOf(scene.orbit, middle, radius);
    const centre = project(view, middle[0]!, middle[1]!, middle[2]!, 1, 1)[2];
    const rows = inSteps(view, watching.low_mm, watching.high_mm, kPlaceSteps);
    const half = Math.min(this.size.x, this.size.y) / 2;
    const u = this.material.uniforms as Record<string, { value: unknown }>;
    (u["rowX"]!.value as Vector4).set(rows[0]!, rows[1]!, rows[2]!, rows[3]!);
    (u["rowY"]!.value as Vector4).set(rows[4]!, rows[5]!, rows[6]!, rows[7]!);
    (u["rowW"]!.value as Vector4).set(rows[8]!, rows[9]!, rows[10]!, rows[11]!);
    (u["aspect"]!.value as Vector2).set((2 * half) / this.size.x, (2 * half) / this.size.y);
    const focal = half * watching.pitch_mm * kFocal;
    u["focal"]!.value = focal;
    u["near"]!.value = centre - radius;
    u["depth"]!.value = 1 / (2 * radius);
    const adapted = this.adaptation.factor(this.store, rows, scene.sweep, this.size.x, this.size.y,
      (w) => sideOf(focal, w, kLargest) ** 2, (w) => depthCue((w - centre + radius) / (2 * radius)));
    u["amount"]!.value = scene.exposure * adapted;
    const slices = Math.max(1, watching.display.layout.slices ?? 1);
    u["first"]!.value = scene.sweep.first;
    u["reach"]!.value = scene.sweep.length;
    u["fades"]!.value = scene.sweep.fades ? 1 : 0;
    u["slices"]!.value = slices;
    if (this.dark !== null) this.dark.visible = scene.dark;
    this.gl.setRenderTarget(this.target);
    this.gl.setClearColor(0, 0);
    this.gl.clear();
    this.gl.render(this.stage, this.camera);
    this.gl.setRenderTarget(null);
    this.gl.render(this.developing, this.camera);
    this.onDrawn({ volume: this.store.volume, points: this.store.lit(scene.sweep), milliseconds: performance.now() - began });
  }
}
