// Measures the page in a headless browser without a GPU: pictures per second while the camera moves around a static
// rotor; the time from a commit to its pixels; and the daemon's cost with no viewer, one viewer, and one that sleeps.
//   node page_bench.mjs --bin DIR --wheel WHEEL --modules NODE_MODULES [--points N] [--seconds S] [--json]
import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";

const { values: options } = parseArgs({ options: {
  bin: { type: "string" }, wheel: { type: "string" }, modules: { type: "string" }, points: { type: "string", default: "235000" },
  seconds: { type: "string", default: "10" }, json: { type: "boolean", default: false },
} });
if (!options.bin || !options.wheel || !options.modules) {
  console.error("usage: page_bench.mjs --bin DIR --wheel WHEEL --modules NODE_MODULES [--points N] [--seconds S] [--json]");
  process.exit(2);
}
const { chromium } = createRequire(join(resolve(options.modules), "x"))("playwright-core");
const seconds = Number(options.seconds);
const folder = mkdtempSync(join(tmpdir(), "voxeld-page-bench-"));
const server = `unix:${folder}/voxeld.sock`;
const port = await new Promise((done) => {
  const probe = createServer();
  probe.listen(0, "127.0.0.1", () => {
    const { port: free } = probe.address();
    probe.close(() => done(free));
  });
});
const kTicks = Number(execFileSync("getconf", ["CLK_TCK"]));

const daemon = spawn(join(options.bin, "voxeld"), ["--listen", server, "--http", `127.0.0.1:${port}`, "--log-level", "warn", "--engine", "cpu",
  "--display", "rotor=simulated,geometry=rotor,size=128x64,slices=360,rate=30"], { stdio: ["ignore", "pipe", "inherit"] });
await new Promise((done) => daemon.stdout.on("data", (text) => /engine:/.test(text) && done()));

// Returns the seconds of CPU time that the daemon has used.
const used = () => {
  const fields = readFileSync(`/proc/${daemon.pid}/stat`, "utf8").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / kTicks;
};

// Starts a feed. Returns: its commits so far, and a promise of all of them that resolves when the feed ends.
function feed(points, rate, time) {
  const child = spawn("/usr/bin/python3", [join(dirname(fileURLToPath(import.meta.url)), "feed.py"), server, String(points), String(rate), String(time)],
    { env: { ...process.env, PYTHONPATH: options.wheel }, stdio: ["ignore", "pipe", "inherit"] });
  const commits = [];
  createInterface({ input: child.stdout }).on("line", (line) => commits.push(JSON.parse(line)));
  const ended = new Promise((done) => child.on("close", () => done(commits)));
  return { commits, ended };
}
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const quantile = (sorted, q) => sorted[Math.min(sorted.length - 1, Math.floor(sorted.length * q))];
const told = (all) => {
  const sorted = [...all].sort((a, b) => a - b);
  return { p50: quantile(sorted, 0.5), p99: quantile(sorted, 0.99), count: sorted.length };
};

const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"], timeout: 120_000 });
async function open() {
  const page = await browser.newPage({ viewport: { width: 960, height: 700 } });
  page.setDefaultTimeout(120_000);
  const began = performance.now();
  await page.goto(`http://127.0.0.1:${port}/?renderer=2d`);
  await page.waitForFunction(() => globalThis.voxeld?.inspect().frames > 0);
  const first = performance.now() - began;
  await page.click("#toggle");
  return { page, first };
}
// When each volume was drawn (ms, Unix time).
const watchDrawn = (page) => page.evaluate(() => {
  globalThis.seen = [];
  const view = globalThis.voxeld.first();
  const before = view.onDrawn;
  view.onDrawn = (drawn) => {
    globalThis.seen.push([drawn.volume, performance.timeOrigin + performance.now()]);
    before(drawn);
  };
});

const result = { points: Number(options.points) };
try {
  const still = feed(options.points, 0.5 / seconds, seconds + 8); // one commit, which stays shown meanwhile
  const { page, first } = await open();
  result.first_picture_ms = first;
  await page.waitForFunction(() => globalThis.voxeld.inspect().drawn.points > 1000);
  result.still = await page.evaluate(async (time) => {
    const { voxeld } = globalThis;
    const before = voxeld.inspect().frames;
    const began = performance.now();
    const took = [];
    while (performance.now() - began < time * 1000) {
      voxeld.orbit.azimuth += 2;
      voxeld.redraw();
      await new Promise((done) => requestAnimationFrame(done));
      took.push(voxeld.inspect().drawn.milliseconds);
    }
    took.sort((a, b) => a - b);
    const { renderer, drawn, frames } = voxeld.inspect();
    return { renderer, pixels: drawn.points, per_second: (frames - before) / ((performance.now() - began) / 1000), ms: took[took.length >> 1] };
  }, seconds);
  result.still.lit_voxels = JSON.parse(execFileSync(join(options.bin, "voxelctl"), ["--server", server, "--json", "stats"]).toString()).displays[0].lit_voxels;
  await still.ended;
  await page.close();

  // The cost of a viewer: the same feed without one, with one, and with one that is connected and does not respond.
  const cost = async (whileFed) => {
    const fed = feed(20_000, 10, seconds + 2);
    await pause(2000);
    const [time, before] = [performance.now(), used()];
    const more = await whileFed();
    const share = (used() - before) / ((performance.now() - time) / 1000);
    return { share, commits: await fed.ended, ...more };
  };
  const none = await cost(() => pause(seconds * 1000));
  const viewer = await open();
  await watchDrawn(viewer.page);
  const one = await cost(() => pause(seconds * 1000));
  const seen = new Map();
  for (const [volume, at] of await viewer.page.evaluate(() => globalThis.seen)) if (!seen.has(volume)) seen.set(volume, at);
  const drawn = one.commits.filter((commit) => seen.has(commit.volume));
  result.commit_to_pixels_ms = told(drawn.map((commit) => seen.get(commit.volume) - commit.made));
  result.commit_to_light_ms = told(one.commits.map((commit) => commit.shown - commit.made));
  result.beyond_the_volume_ms = told(drawn.map((commit) => seen.get(commit.volume) - commit.shown));
  await viewer.page.evaluate(() => (globalThis.requestAnimationFrame = () => 0)); // like a hidden tab
  const asleep = await cost(() => pause(seconds * 1000));
  result.cores = { without: none.share, with_one: one.share, asleep: asleep.share, of_one: one.share - none.share, of_a_sleeper: asleep.share - none.share };
} finally {
  await browser.close();
  daemon.kill("SIGTERM");
  await new Promise((done) => daemon.on("exit", done));
  rmSync(folder, { recursive: true, force: true });
}
if (options.json) {
  console.log(JSON.stringify(result));
} else {
  const ms = (value) => `${value.toFixed(1)} ms`;
  console.log(`first picture ${ms(result.first_picture_ms)}`);
  console.log(`${result.still.lit_voxels} lit voxels, ${result.still.pixels} pixels, ${result.still.renderer}: ${result.still.per_second.toFixed(1)} pictures/s, each ${ms(result.still.ms)}`);
  for (const [name, key] of [["commit to pixels", "commit_to_pixels_ms"], ["commit to its receipt", "commit_to_light_ms"], ["pixels after the receipt", "beyond_the_volume_ms"]]) {
    console.log(`${name}: p50 ${ms(result[key].p50)}, p99 ${ms(result[key].p99)} of ${result[key].count}`);
  }
  console.log(`daemon, cores: ${result.cores.without.toFixed(3)} without a viewer, ${result.cores.with_one.toFixed(3)} with one, ${result.cores.asleep.toFixed(3)} with one asleep`);
}
