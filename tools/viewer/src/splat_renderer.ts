// The page's side of the splat.
import { Watching } from "./protocol";
import { Drawn, Renderer, Scene } from "./renderer";
import type { ToWorker } from "./splat_worker";

const kWorker = "/splat_worker.js";
// Picture elements of the splat per picture element of the page: more costs time without visible effect.
const kMostRatio = 1.5;

export class SplatRenderer implements Renderer {
  readonly name = "2D";
  onDrawn: (drawn: Drawn) => void = () => {};
  private readonly worker = new Worker(kWorker, { type: "module" });
  private busy = false;
  private next: Scene | null = null;

  constructor(canvas: HTMLCanvasElement) {
    const surface = canvas.transferControlToOffscreen();
    this.post({ canvas: surface }, [surface]);
    this.worker.onmessage = (event: MessageEvent<{ drawn?: Drawn }>) => {
      if (event.data.drawn === undefined) return;
      this.busy = false;
      this.onDrawn(event.data.drawn);
      const next = this.next;
      this.next = null;
      if (next !== null) this.draw(next);
    };
  }

  begin(watching: Watching): void {
    this.post({ watching });
  }

  update(message: ArrayBuffer): void {
    this.post({ message }, [message]);
  }

  resize(width: number, height: number, ratio: number): void {
    const scale = Math.min(ratio, kMostRatio);
    this.post({ size: [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))] });
  }

  draw(scene: Scene): void {
    if (this.busy) {
      this.next = scene;
      return;
    }
    this.busy = true;
    this.post({ scene });
  }

  dispose(): void {
    this.worker.terminate();
  }

  private post(what: ToWorker, transfer: Transferable[] = []): void {
    this.worker.postMessage(what, transfer);
  }
}

// Measures the milliseconds for a picture of that many points.
export function trySplat(points: number): Promise<number> {
  const worker = new Worker(kWorker, { type: "module" });
  return new Promise((resolve) => {
    worker.onmessage = (event: MessageEvent<{ trial: number }>) => {
      worker.terminate();
      resolve(event.data.trial);
    };
    worker.onerror = () => {
      worker.terminate();
      resolve(Infinity);
    };
    worker.postMessage({ trial: points } satisfies ToWorker);
  });
}
