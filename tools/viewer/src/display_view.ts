// One display on the page: its canvas, its renderer and its camera.
import { Orbit, kHome, sphereOf, viewOf } from "./camera";
import { OutlineColors, drawOutline } from "./outline";
import { Watching } from "./protocol";
import { Drawn, Renderer, Scene, Sweep, wholeSweep } from "./renderer";

export interface Look {
  exposure: number;
  dark: boolean;
  outline: boolean;
  sweep: Sweep | null; // null: all slices
}

export class DisplayView {
  readonly element = document.createElement("div");
  readonly canvas = document.createElement("canvas");
  private readonly overlay = document.createElement("canvas");
  private readonly label = document.createElement("div");
  readonly renderer: Renderer;
  watching: Watching | null = null;
  drawn: Drawn = { volume: 0, points: 0, milliseconds: 0 };
  frames = 0;
  onDrawn: (drawn: Drawn) => void = () => {};
  private readonly observer: ResizeObserver;
  private size: [number, number] = [0, 0];
  private over = "";
  private noted = "";
  private why = "";

  // `told` describes it to people who do not see it.
  constructor(readonly name: string, told: string, makeRenderer: (canvas: HTMLCanvasElement) => Renderer, private readonly redraw: () => void) {
    this.element.className = "view";
    this.overlay.className = "overlay";
    this.overlay.setAttribute("aria-hidden", "true");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", told);
    this.label.className = "label";
    this.label.textContent = name;
    this.element.append(this.canvas, this.overlay, this.label);
    this.renderer = makeRenderer(this.canvas);
    this.renderer.onDrawn = (drawn) => {
      this.drawn = drawn;
      ++this.frames;
      this.onDrawn(drawn);
    };
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.element);
  }

  begin(watching: Watching): void {
    this.watching = watching;
    this.renderer.begin(watching);
  }

  // Sets whether the display gives light, and otherwise why not.
  light(lit: boolean, why: string): void {
    if (this.over !== "") return;
    this.element.classList.toggle("unlit", !lit);
    this.why = lit ? "" : why;
    this.write();
  }

  // Sets a note beside the name, shown while the display gives light.
  note(text: string): void {
    this.noted = text;
    this.write();
  }

  // Ends the view: no more messages of this watch will come.
  end(why: string): void {
    this.over = why;
    this.element.classList.add("unlit");
    this.why = why;
    this.write();
  }

  draw(orbit: Orbit, look: Look, colors: OutlineColors): void {
    const { watching } = this;
    if (watching === null || this.size[0] === 0) return;
    const scene: Scene = {
      orbit, exposure: look.exposure, dark: look.dark,
      sweep: look.sweep ?? wholeSweep(watching.display.layout.slices),
    };
    this.renderer.draw(scene);
    const context = this.overlay.getContext("2d");
    if (context === null) return;
    const [width, height] = this.size;
    context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
    if (look.outline) drawOutline(context, this.view(orbit), watching, width, height, colors);
    else context.clearRect(0, 0, width, height);
  }

  // Returns the view as the renderers use it.
  view(orbit: Orbit = kHome): Float64Array {
    const { low_mm, high_mm } = this.watching!.around ?? this.watching!;
    const { middle, radius } = sphereOf(low_mm, high_mm);
    return viewOf(orbit, middle, radius);
  }

  dispose(): void {
    this.observer.disconnect();
    this.renderer.dispose();
    this.element.remove();
  }

  private write(): void {
    this.label.textContent = this.why === "" ? `${this.name}${this.noted}` : `${this.name}: ${this.why}`;
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width === 0 || height === 0) return;
    this.size = [width, height];
    this.overlay.width = Math.round(width * devicePixelRatio);
    this.overlay.height = Math.round(height * devicePixelRatio);
    this.renderer.resize(width, height, devicePixelRatio);
    this.redraw();
  }
}
