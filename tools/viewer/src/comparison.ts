// Shows the scene as it was sent beside what a display shows, and their difference. It asks the daemon again whenever a
// display shows something else, one display after the other. If several are viewed, each shows how far it is off.
import { Orbit } from "./camera";
import { DisplayView, Look } from "./display_view";
import { OutlineColors } from "./outline";
import { Compared, LayerInfo, Watching, kDifference, kSent } from "./protocol";

const kTick = 250;
const kAgainAfter = 500; // milliseconds after the answer that there is none yet
const kPatience = 60_000; // milliseconds to wait for an answer

export const layerKey = (layer: { owner: string; layer: string }) => `${layer.owner}/${layer.layer}`;

const count = (n: number) => n.toLocaleString("en");
const share = (part: number, all: number) => (all === 0 ? "0 %" : `${((100 * part) / all).toPrecision(2)} %`);

export function shortly(c: Compared): string {
  return `missing ${share(c.missing, c.voxels)}, stray ${share(c.stray, c.pixels)}, off ${share(c.off, c.pixels)}`;
}

export function atLength(c: Compared): string {
  return `volume ${c.volume}: of ${count(c.voxels)} voxels sent ${count(c.missing)} have no light near (${share(c.missing, c.voxels)}); ` +
    `of ${count(c.pixels)} lit pixels ${count(c.stray)} have no voxel near, and ${count(c.off)} differ in light by more than a level; ` +
    `on the average it is ${c.mean.toFixed(1)} of 255, at the most ${c.most}.`;
}

interface Asking {
  volume: number;
  layers: number; // version of the choice of layers
  notBefore: number;
}

export interface ComparisonPage {
  views(): ReadonlyMap<number, DisplayView>; // of displays, by watch
  ask(id: number, without: { owner: string; layer: string }[]): void;
  makeView(name: string, told: string): DisplayView; // on the page, beside the others
  redraw(): void;
  tell(text: string): void;
}

export class Comparison {
  private on = false;
  private sent: DisplayView | null = null;
  private difference: DisplayView | null = null;
  private readonly known = new Map<number, Asking>();
  private readonly hidden = new Map<string, { owner: string; layer: string }>();
  private choice = 0;
  private underWay: { id: number; since: number } | null = null;
  private came: Compared | null = null; // whose points have not arrived yet
  private timer: ReturnType<typeof setInterval> | undefined;

  constructor(private readonly page: ComparisonPage) {}

  get active(): boolean {
    return this.on;
  }

  set(on: boolean): void {
    if (on === this.on) return;
    this.on = on;
    this.restart();
  }

  // The connection was lost: the daemon will not answer the requests.
  lost(): void {
    this.underWay = null;
  }

  // The viewed displays have changed.
  restart(): void {
    clearInterval(this.timer);
    this.sent?.dispose();
    this.difference?.dispose();
    this.sent = this.difference = this.came = null;
    this.known.clear();
    this.page.tell("");
    for (const view of this.page.views().values()) view.note("");
    if (!this.on) return this.page.redraw();
    const [only, ...others] = this.page.views().values();
    if (only !== undefined && others.length === 0) {
      only.note(" as shown");
      this.sent = this.page.makeView("as sent", `What ${only.name} was sent`);
      this.difference = this.page.makeView("difference: blue is missing, orange too much", `Where ${only.name} differs from what it was sent`);
    }
    this.timer = setInterval(() => this.tick(), kTick);
    this.tick();
  }

  isHidden(layer: LayerInfo): boolean {
    return this.hidden.has(layerKey(layer));
  }

  hide(layer: LayerInfo, hidden: boolean): void {
    if (hidden) this.hidden.set(layerKey(layer), { owner: layer.owner, layer: layer.layer });
    else this.hidden.delete(layerKey(layer));
    ++this.choice;
    this.tick();
  }

  take(compared: Compared): void {
    const view = this.page.views().get(compared.id);
    const asked = this.known.get(compared.id);
    const took = this.underWay === null ? 0 : performance.now() - this.underWay.since;
    this.underWay = null;
    if (view === undefined || asked === undefined || !this.on) return;
    asked.notBefore = performance.now() + took; // so it uses at most half of the time
    if (compared.why !== undefined) {
      asked.volume = -1; // so that it is asked for again
      asked.notBefore = performance.now() + kAgainAfter;
      this.page.tell(`${view.name} is not compared: ${compared.why}.`);
      return;
    }
    asked.volume = Number(compared.volume);
    if (this.sent === null) view.note(`: ${shortly(compared)}`);
    this.page.tell(`${view.name}, ${atLength(compared)}`);
    this.came = compared;
  }

  // Returns whether the message belongs to a comparison. The previous points stay until it is complete.
  points(message: ArrayBuffer): boolean {
    const header = new DataView(message);
    const kind = header.getUint8(0);
    if (kind !== kSent && kind !== kDifference) return false;
    const id = header.getUint16(2, true);
    const view = kind === kSent ? this.sent : this.difference;
    const shown = this.page.views().get(id)?.watching ?? null;
    if (view === null || shown === null || this.came?.id !== id) return true;
    view.begin(placesOf(this.came, shown));
    view.renderer.update(message);
    view.note(`, of volume ${this.came.volume}`);
    this.page.redraw();
    return true;
  }

  // Updates the known layers: a removed layer is not left out any longer.
  know(layers: LayerInfo[]): void {
    const there = new Set(layers.map(layerKey));
    for (const key of this.hidden.keys()) if (!there.has(key)) this.hidden.delete(key);
  }

  draw(orbit: Orbit, look: Look, colors: OutlineColors): void {
    const all: Look = { ...look, dark: false, sweep: null }; // these have no slices
    this.sent?.draw(orbit, all, colors);
    this.difference?.draw(orbit, all, colors);
  }

  // For tests.
  drawn(): object {
    return { sent: this.sent?.drawn, difference: this.difference?.drawn };
  }

  private tick(): void {
    const now = performance.now();
    if (this.underWay !== null && now - this.underWay.since > kPatience) this.underWay = null;
    if (!this.on || this.underWay !== null || document.hidden) return;
    for (const [id, view] of this.page.views()) {
      const asked = this.known.get(id);
      if (view.watching === null || view.drawn.volume === 0) continue;
      if (asked !== undefined && (now < asked.notBefore || (asked.volume === view.drawn.volume && asked.layers === this.choice))) continue;
      this.known.delete(id); // reinserted at the end of the queue
      this.known.set(id, { volume: view.drawn.volume, layers: this.choice, notBefore: 0 });
      this.underWay = { id, since: now };
      this.page.ask(id, [...this.hidden.values()]);
      return;
    }
  }
}

// Returns a view without slices, with the camera of the display.
function placesOf(compared: Compared, shown: Watching): Watching {
  const { low_mm, high_mm, pitch_mm } = compared;
  return {
    id: compared.id, low_mm, high_mm, pitch_mm, around: { low_mm: shown.low_mm, high_mm: shown.high_mm },
    display: { ...shown.display, layout: { ...shown.display.layout, slices: 1 } },
  };
}
