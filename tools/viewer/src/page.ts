// The page: choosing displays, looking around them, and describing them. The address (display, camera, slice) can be
// sent to others.
import { Orbit, kHome, project } from "./camera";
import { Comparison } from "./comparison";
import { Connection } from "./connection";
import { DisplayView, Look } from "./display_view";
import { Dropped } from "./dropped";
import { GlRenderer } from "./gl_renderer";
import { Panels } from "./panels";
import { DisplayDescription, FromDaemon, Hello } from "./protocol";
import { Renderer } from "./renderer";
import { SplatRenderer, trySplat } from "./splat_renderer";

const kTrialPoints = 100_000;
const kStatsEvery = 1000;
const kMostViews = 9;
const kAgainAfter = 2000;

const byId = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
const input = (id: string) => byId<HTMLInputElement>(id);

class Page {
  private readonly connection: Connection;
  private readonly panels = new Panels();
  private readonly dropped = new Dropped(document.querySelector("main")!, byId("control"), (message) => this.connection.send(message), (text) => this.say(text));
  private readonly views = new Map<number, DisplayView>();
  private hello: Hello | null = null;
  private chosen = ""; // empty: all
  private orbit: Orbit = { ...kHome, target: [0, 0, 0] };
  private readonly look: Look = { exposure: 1, dark: false, outline: true, sweep: null };
  private readonly comparison: Comparison;
  private nextWatch = 0;
  private dirty = false;
  // Watches whose newest volume, with that number, has not been drawn yet.
  private readonly owed = new Map<number, number>();
  private framesBefore = 0;
  private sweepAt = 0;
  private lastTick = 0;

  constructor(private readonly makeRenderer: (canvas: HTMLCanvasElement) => Renderer) {
    this.comparison = new Comparison({
      views: () => this.views,
      ask: (id, without) => this.connection.send({ compare: id, without }),
      makeView: (name, told) => {
        const view = new DisplayView(name, told, this.makeRenderer, () => this.redraw());
        byId("views").append(view.element);
        return view;
      },
      redraw: () => this.redraw(),
      tell: (text) => this.compared(text),
    });
    this.readAddress();
    this.wire();
    this.connection = new Connection({
      onOpen: () => this.connection.send({ hello: true }),
      onMessage: (message) => this.take(message),
      onPoints: (message) => this.points(message),
      onClosed: () => this.closed(),
    });
    setInterval(() => this.askForFigures(), kStatsEvery);
    document.addEventListener("visibilitychange", () => this.redraw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
  }

  // ---- what comes

  private take(message: FromDaemon): void {
    if (message.hello !== undefined) this.begin(message.hello);
    if (message.watching !== undefined) {
      this.views.get(message.watching.id)?.begin(message.watching);
      if (this.look.dark) this.connection.send({ dark: message.watching.id });
      this.slicesKnown();
      this.redraw();
    }
    if (message.ended !== undefined) this.ended(message.ended.id, message.ended.why);
    if (message.stats !== undefined) this.figures(message.stats);
    if (message.layers !== undefined) {
      this.comparison.know(message.layers.layers ?? []);
      this.panels.layers(message.layers.layers ?? [], this.hello?.control ?? false,
        (layer) => this.connection.send({ clear: { owner: layer.owner, layer: layer.layer } }), {
          isHidden: (layer) => this.comparison.isHidden(layer),
          hide: (layer, hidden) => {
            this.comparison.hide(layer, hidden);
            this.compare(true);
          },
        });
    }
    if (message.display !== undefined) this.settings(message.display);
    if (message.compared !== undefined) this.comparison.take(message.compared);
    this.dropped.told(message);
    if (message.error !== undefined) this.say(message.error);
  }

  private points(message: ArrayBuffer): void {
    if (this.comparison.points(message)) return;
    const header = new DataView(message);
    const watch = header.getUint16(2, true);
    const view = this.views.get(watch);
    if (view === undefined) return;
    if (header.getUint8(0) === 1) this.owed.set(watch, Number(header.getBigUint64(16, true)));
    view.renderer.update(message);
    this.redraw();
  }

  private begin(hello: Hello): void {
    this.hello = hello;
    byId("version").textContent = `voxeld ${hello.version}`;
    byId("offline").hidden = true;
    document.body.classList.toggle("control", hello.control);
    byId("control").hidden = !hello.control;
    const select = byId<HTMLSelectElement>("display");
    const names = hello.displays.map((display) => display.name);
    const options = names.map((name) => new Option(name, name));
    if (names.length > 1) options.push(new Option("all of them", ""));
    select.replaceChildren(...options);
    if (!names.includes(this.chosen) && !(this.chosen === "" && names.length > 1 && this.wantsAll)) this.chosen = names[0] ?? "";
    select.value = this.chosen;
    this.watch();
  }

  private wantsAll = new URLSearchParams(location.hash.slice(1)).get("display") === "";

  // The display stopped, or its bytes could not be read: the picture is outdated.
  private ended(id: number, why: string): void {
    const view = this.views.get(id);
    if (view === undefined) return;
    view.end(why);
    setTimeout(() => {
      if (this.views.get(id) === view) this.watch();
    }, kAgainAfter);
  }

  private closed(): void {
    byId("offline").hidden = false;
    this.owed.clear();
    this.comparison.lost();
  }

  private watch(): void {
    for (const [id, view] of this.views) {
      this.connection.send({ unwatch: id });
      view.dispose();
    }
    this.views.clear();
    this.owed.clear();
    this.panels.restart();
    const displays = (this.hello?.displays ?? []).filter((display) => this.chosen === "" || display.name === this.chosen).slice(0, kMostViews);
    for (const display of displays) {
      const id = this.nextWatch++ % 65536;
      const view = new DisplayView(display.name, `What display ${display.name} shows`, this.makeRenderer, () => this.redraw());
      view.onDrawn = () => {
        if (this.owed.get(id) === view.drawn.volume) {
          this.owed.delete(id);
          this.connection.send({ shown: id });
        }
        byId("views").dataset["volume"] = String(view.drawn.volume);
      };
      this.views.set(id, view);
      byId("views").append(view.element);
      this.connection.send({ watch: display.name, id });
    }
    this.comparison.restart();
    const first = displays[0];
    if (first !== undefined) this.settings(first);
    this.askForFigures();
  }

  private figures(stats: NonNullable<FromDaemon["stats"]>): void {
    const view = this.first();
    const frames = [...this.views.values()].reduce((sum, each) => sum + each.frames, 0);
    if (!byId("panel").hidden) this.panels.figures(stats, view?.name ?? "", {
      points: [...this.views.values()].reduce((sum, each) => sum + each.drawn.points, 0),
      frames: Math.max(0, frames - this.framesBefore),
      renderer: view?.renderer.name ?? "",
    });
    this.framesBefore = frames;
    for (const each of this.views.values()) {
      const display = stats.displays.find((d) => d.name === each.name);
      const dark = display !== undefined && display.state !== "DISPLAY_STATE_SHOWING";
      each.light(!dark, dark ? display.state_reason : "");
    }
  }

  private settings(display: DisplayDescription): void {
    input("brightness").value = String(display.brightness);
    input("blank").checked = display.blank;
    byId<HTMLSelectElement>("pattern").value = display.test_pattern === "TEST_PATTERN_UNSPECIFIED" ? "TEST_PATTERN_NONE" : display.test_pattern;
    const { grid } = display.geometry;
    byId("geometry").textContent = `${kindOf(display)}, ${grid.nx}×${grid.ny}×${grid.nz} voxels; ${display.layout.slices} slices of ${display.layout.width}×${display.layout.height}`;
  }

  private askForFigures(): void {
    if (document.hidden) return;
    this.connection.send({ stats: true }); // includes the displays' state
    if (!byId("panel").hidden) this.connection.send({ layers: true });
  }

  private say(text: string): void {
    const said = byId("said");
    said.textContent = text;
    said.hidden = false;
    setTimeout(() => (said.hidden = true), 8000);
  }

  // ---- drawing: once for all that changed, and not at all while nobody sees it

  private redraw(): void {
    if (this.dirty) return;
    this.dirty = true;
    requestAnimationFrame((now) => {
      this.dirty = false;
      this.turn(now);
      const theme = getComputedStyle(document.documentElement);
      const color = (name: string) => theme.getPropertyValue(name).trim();
      const colors = { line: color("--outline"), text: color("--dim"), axes: [color("--x"), color("--y"), color("--z")] as [string, string, string] };
      for (const view of this.views.values()) view.draw(this.orbit, this.look, colors);
      this.comparison.draw(this.orbit, this.look, colors);
    });
  }

  // A slow-motion sweep advances by the elapsed time.
  private turn(now: number): void {
    const passed = this.lastTick === 0 ? 0 : Math.min(0.1, (now - this.lastTick) / 1000);
    this.lastTick = now;
    const slices = this.first()?.watching?.display.layout.slices ?? 0;
    if (slices === 0) return;
    const play = input("sweep").checked;
    if (play) {
      this.sweepAt = (this.sweepAt + passed * slices * Number(input("speed").value)) % slices;
      const length = Math.max(1, Math.round(slices * Number(input("persistence").value)));
      this.look.sweep = { first: Math.floor(this.sweepAt), length, fades: length < slices };
      this.redraw();
    } else if (input("one").checked) {
      this.look.sweep = { first: Number(input("slice").value), length: 1, fades: false };
      this.lastTick = 0;
    } else {
      this.look.sweep = null;
      this.lastTick = 0;
    }
    const at = this.look.sweep;
    byId("slice-number").textContent = at === null ? "all" : `${at.first + 1} of ${slices}`;
    if (play) input("slice").value = String(Math.floor(this.sweepAt));
  }

  private slicesKnown(): void {
    const slices = this.first()?.watching?.display.layout.slices ?? 1;
    input("slice").max = String(slices - 1);
    if (Number(input("slice").value) >= slices) input("slice").value = String(slices - 1);
  }

  private first(): DisplayView | undefined {
    return this.views.values().next().value;
  }

  // ---- what people do

  private wire(): void {
    const views = byId("views");
    const pointers = new Map<number, [number, number]>();
    views.addEventListener("pointerdown", (event) => {
      views.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    views.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (before === undefined) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)![1];
        const was = Math.hypot(before[0] - other[0], before[1] - other[1]);
        const is = Math.hypot(event.clientX - other[0], event.clientY - other[1]);
        if (was > 0 && is > 0) this.zoom(was / is);
      } else if (event.shiftKey || event.buttons === 4) {
        this.pan(dx, dy);
      } else {
        this.orbit.azimuth = (this.orbit.azimuth - dx * 0.4 + 540) % 360 - 180;
        this.orbit.elevation = Math.max(-89, Math.min(89, this.orbit.elevation + dy * 0.4));
      }
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      this.moved();
    });
    for (const kind of ["pointerup", "pointercancel"]) views.addEventListener(kind, (event) => pointers.delete((event as PointerEvent).pointerId));
    views.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.001));
      this.moved();
    }, { passive: false });

    for (const id of ["slice", "one", "sweep", "speed", "persistence"]) {
      input(id).addEventListener("input", () => {
        if (id === "slice") input("one").checked = true;
        if (id === "one" && input("one").checked) input("sweep").checked = false;
        if (id === "sweep" && input("sweep").checked) input("one").checked = false;
        this.moved();
      });
    }
    input("exposure").addEventListener("input", () => {
      this.look.exposure = Math.pow(2, Number(input("exposure").value));
      this.redraw();
    });
    input("compare").addEventListener("input", () => this.compare(input("compare").checked));
    input("dark").addEventListener("input", () => this.setDark(input("dark").checked));
    input("outline").addEventListener("input", () => {
      this.look.outline = input("outline").checked;
      this.redraw();
    });
    byId("display").addEventListener("change", () => {
      this.chosen = byId<HTMLSelectElement>("display").value;
      this.wantsAll = this.chosen === "";
      this.watch();
      this.moved();
    });
    byId("toggle").addEventListener("click", () => {
      const panel = byId("panel");
      panel.hidden = !panel.hidden;
      byId("toggle").setAttribute("aria-expanded", String(!panel.hidden));
      this.askForFigures();
    });
    input("brightness").addEventListener("change", () => this.update({ brightness: Number(input("brightness").value) }));
    input("blank").addEventListener("change", () => this.update({ blank: input("blank").checked }));
    byId("pattern").addEventListener("change", () => this.update({ test_pattern: byId<HTMLSelectElement>("pattern").value }));
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
      this.key(event);
    });
  }

  private key(event: KeyboardEvent): void {
    const onSlider = event.target instanceof HTMLInputElement && event.target.type === "range";
    switch (event.key) {
      case "f": case "F": this.orbit.distance = 1; this.orbit.target = [0, 0, 0]; break;
      case "r": case "R": this.orbit = { ...kHome, target: [0, 0, 0] }; input("one").checked = input("sweep").checked = false; break;
      case "s": case "S": input("dark").checked = !this.look.dark; this.setDark(input("dark").checked); return;
      case "c": case "C": this.compare(!this.comparison.active); return;
      case "ArrowLeft": if (onSlider) return; this.orbit.azimuth -= 5; break;
      case "ArrowRight": if (onSlider) return; this.orbit.azimuth += 5; break;
      case "ArrowUp": if (onSlider) return; this.orbit.elevation = Math.min(89, this.orbit.elevation + 5); break;
      case "ArrowDown": if (onSlider) return; this.orbit.elevation = Math.max(-89, this.orbit.elevation - 5); break;
      case "+": this.zoom(1 / 1.1); break;
      case "-": this.zoom(1.1); break;
      default: return;
    }
    event.preventDefault();
    this.moved();
  }

  private zoom(factor: number): void {
    this.orbit.distance = Math.max(0.15, Math.min(6, this.orbit.distance * factor));
  }

  private pan(dx: number, dy: number): void {
    const view = this.first();
    if (view?.watching == null) return;
    const extent = Math.hypot(...view.watching.low_mm.map((low, i) => view.watching!.high_mm[i]! - low));
    const step = (extent * this.orbit.distance) / Math.min(view.element.clientWidth, view.element.clientHeight);
    const a = (this.orbit.azimuth * Math.PI) / 180;
    this.orbit.target[0] -= dx * step * Math.cos(a);
    this.orbit.target[1] -= dx * step * Math.sin(a);
    this.orbit.target[2] += dy * step;
  }

  private setDark(dark: boolean): void {
    this.look.dark = dark;
    if (dark) for (const id of this.views.keys()) this.connection.send({ dark: id });
    this.redraw();
  }

  private compare(on: boolean): void {
    input("compare").checked = on;
    this.comparison.set(on);
    this.moved();
  }

  private compared(text: string): void {
    byId("compared").textContent = text;
    byId("comparison").hidden = !this.comparison.active;
  }

  private update(change: object): void {
    this.connection.send({ update: { name: this.first()?.name ?? "", ...change } });
  }

  // ---- the address

  private moved(): void {
    const { azimuth, elevation, distance, target } = this.orbit;
    const parts = new URLSearchParams({
      display: this.chosen, camera: [azimuth, elevation, distance, ...target].map((v) => Number(v.toFixed(3))).join(","),
    });
    if (input("one").checked) parts.set("slice", input("slice").value);
    if (this.comparison.active) parts.set("compare", "1");
    history.replaceState(null, "", `#${parts.toString()}`);
    this.redraw();
  }

  private readAddress(): void {
    const parts = new URLSearchParams(location.hash.slice(1));
    this.chosen = parts.get("display") ?? "";
    const camera = (parts.get("camera") ?? "").split(",").map(Number);
    if (camera.length === 6 && camera.every(Number.isFinite)) {
      const [azimuth, elevation, distance, x, y, z] = camera as [number, number, number, number, number, number];
      this.orbit = { azimuth, elevation: Math.max(-89, Math.min(89, elevation)), distance: Math.max(0.15, Math.min(6, distance)), target: [x, y, z] };
    }
    input("compare").checked = parts.get("compare") === "1";
    this.comparison.set(input("compare").checked);
    const slice = parts.get("slice");
    if (slice !== null && /^\d+$/.test(slice)) {
      input("slice").max = slice; // until the number of slices is known
      input("slice").value = slice;
      input("one").checked = true;
    }
  }

  // For tests and curious people: where a place in millimetres is on the first display's canvas, and what is drawn.
  inspect(): object {
    const view = this.first();
    return {
      renderer: view?.renderer.name ?? "",
      drawn: view?.drawn,
      frames: view?.frames ?? 0,
      compared: this.comparison.drawn(),
      place: (x: number, y: number, z: number) => view?.watching == null ? null
        : project(view.view(this.orbit), x, y, z, view.element.clientWidth, view.element.clientHeight),
    };
  }
}

function kindOf(display: DisplayDescription): string {
  const { geometry } = display;
  if (geometry.rotor !== undefined) return geometry.rotor.panels.length > 1 ? `rotor of ${geometry.rotor.panels.length} panels` : "rotor";
  if (geometry.helix !== undefined) return "helix";
  if (geometry.lattice !== undefined) return "lattice";
  return "stack of planes";
}

// Chooses the faster of the two, unless the address names one (?renderer=2d or gl).
async function chooseRenderer(): Promise<(canvas: HTMLCanvasElement) => Renderer> {
  const asked = new URLSearchParams(location.search).get("renderer");
  const splat = (canvas: HTMLCanvasElement) => new SplatRenderer(canvas);
  const gl = (canvas: HTMLCanvasElement) => new GlRenderer(canvas);
  if (asked === "2d") return splat;
  if (asked === "gl") return gl;
  const byGl = GlRenderer.try(kTrialPoints);
  if (byGl === Infinity) return splat;
  return byGl < (await trySplat(kTrialPoints)) ? gl : splat;
}

const page = new Page(await chooseRenderer());
Object.assign(globalThis, { voxeld: page });
