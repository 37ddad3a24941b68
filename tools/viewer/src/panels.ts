// The panel beside the volume: the display's statistics, the time of each stage, and the layers of the scene.
import uPlot from "uplot";
import { layerKey } from "./comparison";
import { DisplayStats, Latency, LayerInfo, Stats } from "./protocol";

// Stages of a commit in order: first the daemon's, then the display's own.
const kStages: [string, "stats" | "display"][] = [
  ["sending", "stats"], ["decoding", "stats"], ["applying", "stats"],
  ["waiting", "display"], ["assemble", "display"], ["slice", "display"], ["copy", "display"], ["transferring", "display"], ["showing", "display"],
];
const kHistory = 120;

const byId = (id: string): HTMLElement => document.getElementById(id)!;

export function milliseconds(ns: string | number): number {
  return Number(ns) / 1e6;
}

export function bytes(count: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  for (; count >= 1000 && unit < units.length - 1; ++unit) count /= 1000;
  return `${count.toPrecision(3)} ${units[unit]!}`;
}

function counted(n: string, one: string, many = `${one}s`): string {
  return `${n} ${n === "1" ? one : many}`;
}

function state(text: string): string {
  return text.replace(/^DISPLAY_STATE_/, "").toLowerCase();
}

// The layers that are drawn in the scene as sent.
export interface LayerChoice {
  isHidden(layer: LayerInfo): boolean;
  hide(layer: LayerInfo, hidden: boolean): void;
}

export class Panels {
  private readonly rows = new Map<string, HTMLTableRowElement>();
  private readonly rate: uPlot;
  private readonly data: [number[], number[], number[]] = [[], [], []];
  private bytesBefore = 0;
  private timeBefore = 0;

  constructor() {
    const theme = getComputedStyle(document.documentElement);
    const color = (name: string) => theme.getPropertyValue(name).trim();
    const axis = { stroke: color("--dim"), grid: { stroke: color("--rule"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
    this.rate = new uPlot({
      width: 260, height: 110, cursor: { show: false }, legend: { show: false },
      scales: { x: { time: false }, ms: { range: (_u, _low, high) => [0, Math.max(1, high)] }, y: { range: (_u, _low, high) => [0, Math.max(1, high)] } },
      axes: [{ ...axis, show: false }, { ...axis, size: 34 }, { ...axis, scale: "ms", side: 1, size: 34, grid: { show: false } }],
      series: [{}, { stroke: color("--accent"), width: 1.5 }, { stroke: color("--warm"), width: 1.5, scale: "ms" }],
    }, this.data, byId("chart"));
  }

  figures(stats: Stats, name: string, drawn: { points: number; frames: number; renderer: string }): void {
    const display = stats.displays.find((d) => d.name === name);
    byId("clients").textContent = `${counted(stats.sessions, "session")}, ${counted(stats.layers, "layer")}, ${counted(stats.entities, "entity", "entities")}`;
    byId("drawn").textContent = `${drawn.points.toLocaleString("en")} lit pixels, ${drawn.frames} pictures/s (${drawn.renderer})`;
    if (display === undefined) return;
    const time = Number(stats.time_ns) / 1e9;
    const sent = Number(display.bytes_out);
    const rate = this.timeBefore > 0 && time > this.timeBefore ? (sent - this.bytesBefore) / (time - this.timeBefore) : 0;
    this.timeBefore = time;
    this.bytesBefore = sent;
    const shown = byId("state");
    shown.textContent = `${state(display.state)}${display.state_reason && state(display.state) !== display.state_reason ? `: ${display.state_reason}` : ""}`;
    shown.dataset["state"] = state(display.state);
    byId("engine").textContent = `${display.engine || "none"}${display.engine_device ? `, ${display.engine_device}` : ""}${display.engine_degraded ? ` (${display.engine_degraded})` : ""}`;
    byId("volumes").textContent = `${display.volumes_per_second.toFixed(1)}/s, ${Number(display.volumes_presented).toLocaleString("en")} in all`;
    byId("sent").textContent = `${bytes(rate)}/s, ${bytes(sent)} in all`;
    byId("lost").textContent = `${display.volumes_lost} volumes, ${display.commits_lost} commits`;
    byId("superseded").textContent = `${display.commits_superseded} commits`;
    byId("lit").textContent = Number(display.lit_voxels).toLocaleString("en");
    this.bar(stats, display);
    const total = display["commit_to_presented"] as Latency;
    const [x, volumes, latency] = this.data;
    x.push(time);
    volumes.push(display.volumes_per_second);
    latency.push(milliseconds(total.p50_ns));
    if (x.length > kHistory) for (const series of this.data) series.shift();
    this.rate.setData([x, volumes, latency]);
  }

  // Discards the data of the previous display.
  restart(): void {
    for (const series of this.data) series.length = 0;
    this.timeBefore = 0;
  }

  // Updates the rows. They stay as long as their layers do, so that the keyboard focus stays in place.
  layers(all: LayerInfo[], control: boolean, clear: (layer: LayerInfo) => void, choice: LayerChoice): void {
    const body = byId("layers");
    const keys = new Set(all.map(layerKey));
    for (const [key, row] of this.rows) {
      if (keys.has(key)) continue;
      row.remove();
      this.rows.delete(key);
    }
    for (const [i, layer] of all.entries()) {
      const row = this.rows.get(layerKey(layer)) ?? this.addRow(layer, control, clear, choice);
      const [box, name, client, entities, seen] = row.cells as unknown as HTMLTableCellElement[];
      (box!.firstChild as HTMLInputElement).checked = !choice.isHidden(layer);
      const texts = [layer.layer || "(default)", layer.client_name, layer.entities, layer.visible ? `${Math.round(layer.opacity / 2.55)} %` : "hidden"];
      // As text, because a client chose the names.
      [name, client, entities, seen].forEach((cell, n) => (cell!.textContent = texts[n]!));
      if (body.children[i] !== row) body.insertBefore(row, body.children[i] ?? null);
    }
    byId("no-layers").hidden = all.length > 0;
  }

  private addRow(layer: LayerInfo, control: boolean, clear: (layer: LayerInfo) => void, choice: LayerChoice): HTMLTableRowElement {
    const row = document.createElement("tr");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.setAttribute("aria-label", `Layer ${layer.layer || "(default)"} in the scene as sent`);
    box.oninput = () => choice.hide(layer, !box.checked);
    row.insertCell().append(box);
    for (let i = 0; i < 4; ++i) row.insertCell();
    if (control) {
      const button = document.createElement("button");
      button.textContent = "clear";
      button.setAttribute("aria-label", `Clear layer ${layer.layer || "(default)"}`);
      button.onclick = () => clear(layer);
      row.insertCell().append(button);
    }
    this.rows.set(layerKey(layer), row);
    return row;
  }

  // Shows the medians one after another: together they are the duration of a commit, with every stage.
  private bar(stats: Stats, display: DisplayStats): void {
    const parts = kStages.map(([name, of]) => {
      const latency = (of === "stats" ? stats[name] : display[name]) as Latency | undefined;
      return { name, ms: latency === undefined ? 0 : milliseconds(latency.p50_ns) };
    });
    const sum = parts.reduce((all, part) => all + part.ms, 0);
    byId("stages").replaceChildren(...parts.filter((part) => part.ms > 0).map((part) => {
      const piece = document.createElement("span");
      piece.className = `stage ${part.name}`;
      piece.style.flexGrow = String(part.ms / Math.max(sum, 1e-9));
      piece.title = `${part.name}: ${part.ms.toFixed(2)} ms`;
      return piece;
    }));
    const longest = [...parts].sort((a, b) => b.ms - a.ms).slice(0, 3).filter((part) => part.ms > 0);
    byId("latency").textContent = sum > 0 ? `${sum.toFixed(1)} ms by its stages' medians; ${longest.map((part) => `${part.name} ${part.ms.toFixed(1)}`).join(", ")}` : "nothing was committed of late";
  }
}
