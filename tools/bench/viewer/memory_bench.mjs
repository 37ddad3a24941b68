// Measures the page's memory while very many commits come, for a third of the time in a tab that is frozen like hidden
// ones: JavaScript's heap after collection, buffers of the GPU renderer, and the memory of the browser's processes and
// the daemon, after every twentieth of the run.
//   node memory_bench.mjs --bin DIR --wheel WHEEL --modules NODE_MODULES [--commits N] [--renderer 2d|gl] [--json]
// Ends with 1 if the last fifth holds a tenth more than the second fifth (the first is for warming up).
import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";

const { values: options } = parseArgs({ options: {
  bin: { type: "string" }, wheel: { type: "string" }, modules: { type: "string" }, commits: { type: "string", default: "100000" },
  renderer: { type: "string", default: "2d" }, json: { type: "boolean", default: false },
} });
if (!options.bin || !options.wheel || !options.modules) {
  console.error("usage: memory_bench.mjs --bin DIR --wheel WHEEL --modules NODE_MODULES [--commits N] [--renderer 2d|gl] [--json]");
  process.exit(2);
}
const { chromium } = createRequire(join(resolve(options.modules), "x"))("playwright-core");
const kSamples = 20;
const kMore = 1.1; // ratio of the last fifth to the second
const folder = mkdtempSync(join(tmpdir(), "voxeld-page-memory-"));
const server = `unix:${folder}/voxeld.sock`;
const port = await new Promise((done) => {
  const probe = createServer();
  probe.listen(0, "127.0.0.1", () => {
    const { port: free } = probe.address();
    probe.close(() => done(free));
  });
});
const daemon = spawn(join(options.bin, "voxeld"), ["--listen", server, "--http", `127.0.0.1:${port}`, "--log-level", "warn", "--engine", "cpu",
  "--display", "rotor=simulated,geometry=rotor,size=64x32,slices=180,rate=1000"], { stdio: ["ignore", "pipe", "inherit"] });
await new Promise((done) => daemon.stdout.on("data", (text) => /engine:/.test(text) && done()));

const resident = (pid) => Number(/^VmRSS:\s+(\d+)/m.exec(readFileSync(`/proc/${pid}/status`, "utf8"))?.[1] ?? 0) * 1024;
// Returns a process and its descendants.
function family(pid) {
  const parents = readdirSync("/proc").filter((name) => /^\d+$/.test(name)).flatMap((name) => {
    try {
      return [[Number(name), Number(readFileSync(`/proc/${name}/stat`, "utf8").split(") ")[1].split(" ")[1])]];
    } catch {
      return []; // it has ended
    }
  });
  const all = [pid];
  for (let i = 0; i < all.length; ++i) all.push(...parents.filter(([, parent]) => parent === all[i]).map(([child]) => child));
  return all;
}
const children = () => new Set(family(process.pid));
const before = children();
const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", timeout: 120_000,
  args: ["--no-sandbox", "--js-flags=--expose-gc", ...(options.renderer === "gl" ? ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] : [])] });
const theirs = () => [...children()].filter((pid) => !before.has(pid)).reduce((sum, pid) => {
  try {
    return sum + resident(pid);
  } catch {
    return sum;
  }
}, 0);

const samples = [];
let ends = 0;
try {
  const page = await browser.newPage({ viewport: { width: 800, height: 600 } });
  page.setDefaultTimeout(120_000);
  const lifecycle = await page.context().newCDPSession(page);
  await page.goto(`http://127.0.0.1:${port}/?renderer=${options.renderer}`);
  await page.waitForFunction(() => globalThis.voxeld?.inspect().frames > 0);
  const sample = async (commits) => {
    await page.evaluate(() => globalThis.gc());
    for (const worker of page.workers()) await worker.evaluate(() => globalThis.gc());
    const { usedSize } = await lifecycle.send("Runtime.getHeapUsage");
    const { frames, gpu_bytes } = await page.evaluate(() => {
      const { renderer, frames: drawn } = globalThis.voxeld.first();
      return { frames: drawn, gpu_bytes: renderer.gpuBytes?.() ?? 0 };
    });
    samples.push({ commits, frames, heap: usedSize, gpu_bytes, browser: theirs(), daemon: resident(daemon.pid) });
    if (!options.json) console.error(`${commits} commits, ${frames} pictures: heap ${(usedSize / 1e6).toFixed(2)} MB, buffers ${(gpu_bytes / 1e6).toFixed(2)} MB, ` +
      `browser ${(samples.at(-1).browser / 1e6).toFixed(0)} MB, daemon ${(samples.at(-1).daemon / 1e6).toFixed(0)} MB`);
  };
  const each = Math.ceil(Number(options.commits) / kSamples);
  const child = spawn("/usr/bin/python3", [join(dirname(fileURLToPath(import.meta.url)), "feed_many.py"), server, options.commits, String(each)],
    { env: { ...process.env, PYTHONPATH: options.wheel }, stdio: ["pipe", "pipe", "inherit"] });
  const lines = createInterface({ input: child.stdout })[Symbol.asyncIterator]();
  for (let turn = 0; turn < kSamples; ++turn) {
    // The tab is hidden during every third part of the run.
    const hidden = turn % 3 === 2;
    if (hidden) await lifecycle.send("Page.setWebLifecycleState", { state: "frozen" });
    child.stdin.write("go\n");
    const commits = Number((await lines.next()).value);
    if (hidden) await lifecycle.send("Page.setWebLifecycleState", { state: "active" });
    await sample(commits);
  }
  child.stdin.end();
} finally {
  await browser.close();
  daemon.kill("SIGTERM");
  await new Promise((done) => daemon.on("exit", done));
  rmSync(folder, { recursive: true, force: true });
}

const fifth = kSamples / 5;
const median = (all) => [...all].sort((a, b) => a - b)[all.length >> 1];
const result = { renderer: options.renderer, commits: samples.at(-1).commits, pictures: samples.at(-1).frames };
for (const key of ["heap", "gpu_bytes", "browser", "daemon"]) {
  const [early, late] = [samples.slice(fifth, 2 * fifth), samples.slice(-fifth)].map((part) => median(part.map((each) => each[key])));
  result[key] = { early, late };
  if (late > early * kMore) ends = 1;
}
if (options.json) {
  console.log(JSON.stringify({ ...result, samples }));
} else {
  console.log(`${result.commits} commits, ${result.pictures} pictures drawn by ${result.renderer}; medians of the second fifth and of the last:`);
  for (const key of ["heap", "gpu_bytes", "browser", "daemon"]) {
    const { early, late } = result[key];
    console.log(`${key}: ${(early / 1e6).toFixed(2)} MB, ${(late / 1e6).toFixed(2)} MB${late > early * kMore ? ": NOT FLAT" : ""}`);
  }
}
process.exit(ends);
