// Tests files dropped on the page, in a browser, and played by voxelctl. NODE_MODULES is where
// playwright-core and the others are.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { chmodSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { setTimeout } from "node:timers/promises";
import { Daemon, freePort } from "./daemon.mjs";

const require = createRequire(join(process.env.NODE_MODULES, "x"));
const { chromium } = require("playwright-core");
const axe = require("axe-core");

const kPatience = Number(process.env.PATIENCE_MS ?? 120_000);
const kCube = "cube=simulated,size=16x16x16,view=voxels";
const data = (name) => readFileSync(join(import.meta.dirname, "../data", name));
process.env.TMPDIR = mkdtempSync(join(tmpdir(), "voxeld-dropped-"));
const kept = () => readdirSync(process.env.TMPDIR).filter((name) => name.startsWith("voxeld-play-"));

let browser;

before(async () => {
  browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"], timeout: kPatience });
}, { timeout: kPatience });
after(async () => {
  await browser?.close();
  rmSync(process.env.TMPDIR, { recursive: true, force: true });
});

async function open(address, more = {}) {
  const context = await browser.newContext({ viewport: { width: 900, height: 700 }, deviceScaleFactor: 1, ...more });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatience);
  await page.goto(address, { timeout: kPatience });
  await page.waitForFunction(() => globalThis.voxeld?.inspect().frames > 0);
  return page;
}

// Drops files like a user: drags them over the views, and releases them.
async function drop(page, ...files) {
  const dataTransfer = await page.evaluateHandle((all) => {
    const transfer = new DataTransfer();
    for (const [name, text] of all) transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
    return transfer;
  }, files.map(([name, bytes]) => [name, Buffer.from(bytes).toString("base64")]));
  await page.dispatchEvent("#views", "dragover", { dataTransfer });
  assert.ok(await page.isVisible("#drop"));
  await page.dispatchEvent("#views", "drop", { dataTransfer });
  assert.equal(await page.isVisible("#drop"), false);
}

const lights = (page, want) => page.waitForFunction((lit) => (globalThis.voxeld.inspect().drawn.points > 0) === lit, want);
const says = (page, id, text) => page.waitForFunction(([where, what]) => document.getElementById(where).textContent.includes(what), [id, text]);

async function until(what, is) {
  const deadline = performance.now() + kPatience;
  while (!is()) {
    assert.ok(performance.now() < deadline, `not within ${kPatience} ms: ${what}`);
    await setTimeout(20);
  }
}

// Returns the process that the terminal's program has started.
function voxeldOf(pid) {
  if (readFileSync(`/proc/${pid}/comm`, "utf8") === "voxeld\n") return pid;
  const [child] = readFileSync(`/proc/${pid}/task/${pid}/children`, "utf8").trim().split(" ");
  return voxeldOf(Number(child));
}

async function withDaemon(options, use) {
  const daemon = await Daemon.start([kCube], { terminal: true, ...options });
  try {
    await use(daemon);
    process.kill(voxeldOf(daemon.process.pid), "SIGTERM"); // the daemon: its terminal would not
                                                           // wait for its exit
    await daemon.ended;
  } finally {
    await daemon.stop();
  }
}

describe("a file dropped on the page", { timeout: 6 * kPatience }, () => {
  test("plays until it is stopped, one after another, and all pages with control are told", async () => {
    await withDaemon({}, async (daemon) => {
      const page = await open(daemon.control);
      const other = await page.context().newPage(); // the same browser, so with the cookie
      other.setDefaultTimeout(kPatience);
      await other.goto(daemon.page);
      await drop(page, ["my arrow.stl", data("arrow.stl")]);
      await lights(page, true);
      await says(page, "playing", "playing my arrow.stl");
      await says(other, "playing", "playing my arrow.stl");
      assert.equal(kept().length, 1);
      await drop(page, ["arrow.obj", data("arrow.obj")]);
      await says(other, "playing", "playing arrow.obj");
      await lights(page, true);
      await other.click("#stop-playing");
      await lights(page, false);
      await page.waitForSelector("#stop-playing", { state: "hidden" });
      assert.equal(await page.textContent("#playing"), "");
      assert.deepEqual(kept(), []);
      await page.setInputFiles("#play-file", { name: "chosen.obj", mimeType: "", buffer: data("arrow.obj") });
      await says(page, "playing", "playing chosen.obj");
      await lights(page, true);
      await page.context().close();
    });
    assert.deepEqual(kept(), [], "it ends with the daemon");
  });

  test("is said to be wrong in voxelctl's words, whatever its name is", async () => {
    await withDaemon({}, async (daemon) => {
      const page = await open(daemon.control);
      await drop(page, ["<img src=x onerror=broken=1>.stl", "these are words\n"]);
      await says(page, "not-played", "an STL begins with");
      assert.match(await page.textContent("#not-played"), /^Not played: _img src=x onerror=broken=1_\.stl: is text that begins with/);
      assert.equal(await page.evaluate(() => globalThis.broken), undefined);
      await page.click("#toggle"); // hides the panel
      await drop(page, ["../../what.docx", "PK"]);
      await says(page, "said", "Not played: what.docx: files of type .docx are not read");
      await page.click("#toggle");
      await says(page, "not-played", "files of type .docx are not read");
      await drop(page, ["a.obj", data("arrow.obj")], ["b.obj", data("arrow.obj")]);
      await says(page, "not-played", "2 files; one is played at a time");
      await drop(page, ["nothing.obj", ""]);
      await says(page, "not-played", "nothing.obj is empty");
      assert.equal((await page.evaluate(() => globalThis.voxeld.inspect().drawn.points)), 0);
      await drop(page, ["arrow.obj", data("arrow.obj")]);
      await lights(page, true);
      assert.equal(await page.isVisible("#not-played"), false);
      await page.context().close();
    });
  });

  test("is refused where the page may only look", async () => {
    await withDaemon({}, async (daemon) => {
      const page = await open(daemon.page);
      const asked = [];
      page.on("request", (request) => asked.push(request.method()));
      await drop(page, ["arrow.obj", data("arrow.obj")]);
      await says(page, "said", "This page may only look");
      assert.deepEqual(asked, []);
      const answer = await page.evaluate(async () => {
        const got = await fetch("/play?name=arrow.obj", { method: "POST", body: "v 0 0 0\n" });
        return [got.status, await got.text()];
      });
      assert.deepEqual([answer[0], /may only look/.test(answer[1])], [403, true]);
      await page.context().close();
    });
  });

  test("is refused where it is too large, or files are not played at all", async () => {
    await withDaemon({ config: "[server]\nhttp_max_upload_bytes = 100\n" }, async (daemon) => {
      const page = await open(daemon.control);
      await page.waitForSelector("#play:not([disabled])");
      await drop(page, ["arrow.obj", "v".repeat(101)]);
      await says(page, "not-played", "files up to 100 B are played");
      await page.context().close();
    });
    await withDaemon({ config: "[server]\nhttp_play = false\n" }, async (daemon) => {
      const page = await open(daemon.control);
      await says(page, "playing", "server.http_play is false");
      assert.ok(await page.isDisabled("#play"));
      await drop(page, ["arrow.obj", data("arrow.obj")]);
      await says(page, "said", "server.http_play is false");
      await page.context().close();
    });
  });

  test("plays where nobody is let in without a token, and there is no unix socket", async () => {
    const folder = mkdtempSync(join(tmpdir(), "voxeld-page-"));
    const hash = createHash("sha256").update("no such token").digest("hex");
    writeFileSync(`${folder}/grants.toml`, `[[token]]\nname = "nobody"\nsha256 = "${hash}"\nscopes = ["view"]\n`, { mode: 0o600 });
    chmodSync(folder, 0o700);
    const listen = `127.0.0.1:${await freePort()}`;
    await withDaemon({ folder, listen, config: `[security]\ngrants = "${folder}/grants.toml"\nunix_scopes = "none"\n` }, async (daemon) => {
      daemon.server = listen;
      await assert.rejects(daemon.voxelctl("draw", "points vertices='1,1,1'"), /may not|token|scope/i);
      const page = await open(daemon.control);
      await drop(page, ["arrow.obj", data("arrow.obj")]);
      await lights(page, true);
      await page.context().close();
    });
    assert.deepEqual(kept(), []);
    rmSync(folder, { recursive: true, force: true });
  });

  test("ends with a daemon that is killed", async () => {
    const daemon = await Daemon.start([kCube], { terminal: true });
    const page = await open(daemon.control);
    await drop(page, ["arrow.obj", data("arrow.obj")]);
    await lights(page, true);
    const voxeld = voxeldOf(daemon.process.pid);
    const player = readdirSync(`/proc/${voxeld}/task`)
      .flatMap((task) => readFileSync(`/proc/${voxeld}/task/${task}/children`, "utf8").trim().split(" "))
      .find((pid) => pid !== "" && readFileSync(`/proc/${pid}/comm`, "utf8") === "voxelctl\n");
    assert.ok(player !== undefined);
    process.kill(voxeld, "SIGKILL");
    await daemon.ended;
    await until("voxelctl has ended", () => {
      try {
        return /\) Z /.test(readFileSync(`/proc/${player}/stat`, "utf8"));
      } catch {
        return true;
      }
    });
    await page.context().close();
    await daemon.stop();
    assert.equal(kept().length, 1, "nobody was there to remove it");
    await withDaemon({}, () => until("what was left is removed by the next one", () => kept().length === 0));
  });

  for (const [name, options] of Object.entries({
    dark: { colorScheme: "dark" }, light: { colorScheme: "light" }, phone: { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
  })) {
    test(`can be used by everybody: ${name}`, async () => {
      await withDaemon({}, async (daemon) => {
        const page = await open(daemon.control, options);
        await drop(page, ["wrong.obj", "no"]);
        await page.waitForSelector("#not-played:not([hidden])");
        await page.evaluate(() => document.querySelectorAll("#sending, #cancel-sending, #stop-playing").forEach((each) => (each.hidden = false)));
        const cdp = await page.context().newCDPSession(page);
        await cdp.send("Page.setBypassCSP", { enabled: true });
        await page.evaluate(axe.source);
        const { violations } = await page.evaluate(() => globalThis.axe.run());
        assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`), []);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(wide <= 0, `${wide} too wide`);
        const choose = options.hasTouch ? () => page.tap("#play") : () => page.press("#play", "Enter");
        const [chooser] = await Promise.all([page.waitForEvent("filechooser"), choose()]);
        await chooser.setFiles({ name: "arrow.obj", mimeType: "", buffer: data("arrow.obj") });
        await lights(page, true);
        await page.context().close();
      });
    });
  }
});
