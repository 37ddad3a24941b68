// Tests the page in a browser: Debian's Chromium without a screen. Its drawing is compared with a
// camera computed here, and screen pixels are counted one by one. NODE_MODULES is where
// playwright-core and the others are.
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { request } from "node:http";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { Daemon } from "./daemon.mjs";

const require = createRequire(join(process.env.NODE_MODULES, "x"));
const { chromium } = require("playwright-core");
const { PNG } = require("pngjs");
const axe = require("axe-core");

const kPatience = Number(process.env.PATIENCE_MS ?? 120_000); // a busy machine's first page may take half a minute
const kSoftware = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const kCube = "cube=simulated,size=16x16x16,view=voxels";
const kRotor = "rotor=simulated,geometry=rotor,size=32x16,slices=60,view=voxels";

let browser, daemon;

async function launch(more = []) {
  return chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox", ...more], timeout: kPatience });
}

// Opens a page and waits until it has drawn the first display. Returns it, with the errors and
// requests that it records.
async function open(address, { width = 800, height = 600, panel = false, browserOf = browser, ...more } = {}) {
  const context = await browserOf.newContext({ viewport: { width, height }, deviceScaleFactor: 1, ...more });
  const page = await context.newPage();
  page.setDefaultTimeout(kPatience);
  const seen = { errors: [], requests: [] };
  page.on("pageerror", (error) => seen.errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));
  page.on("request", (asked) => seen.requests.push(asked.url()));
  page.on("websocket", (socket) => seen.requests.push(socket.url()));
  await page.goto(address, { timeout: kPatience });
  if (!panel) await page.click("#toggle");
  await page.waitForFunction(() => globalThis.voxeld?.inspect().frames > 0);
  return { page, seen, context };
}

const inspect = (page) => page.evaluate(() => {
  const { renderer, drawn, frames } = globalThis.voxeld.inspect();
  return { renderer, drawn, frames };
});

async function drawnPoints(page, points) {
  await page.waitForFunction((wanted) => globalThis.voxeld.inspect().drawn.points === wanted, points);
}

// Returns the canvas of a display, without what is above it.
async function picture(page, index = 0) {
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
  await page.evaluate(() => document.querySelectorAll(".overlay, .label").forEach((over) => (over.style.visibility = "hidden")));
  const shot = await page.locator(".view canvas:first-child").nth(index).screenshot();
  await page.evaluate(() => document.querySelectorAll(".overlay, .label").forEach((over) => (over.style.visibility = "")));
  return PNG.sync.read(shot);
}

// Returns the first picture of a display for which `good` holds. Views that appear are not drawn in
// the same frame in which their volumes arrive.
async function pictureWith(page, index, good) {
  for (let turn = 0; turn < 50; ++turn) {
    const image = await picture(page, index);
    if (good(image)) return image;
  }
  return assert.fail("no picture was as expected, in 50");
}

const at = (image, x, y) => [...image.data.subarray((y * image.width + x) * 4, (y * image.width + x) * 4 + 3)];

// Returns the bounding box of the places that differ from the page's background.
function lit(image, of = () => true) {
  let box = null;
  let count = 0;
  for (let y = 0; y < image.height; ++y) {
    for (let x = 0; x < image.width; ++x) {
      const color = at(image, x, y);
      if (Math.max(...color) < 40 || !of(color)) continue;
      ++count;
      box = box === null ? [x, y, x, y] : [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
    }
  }
  return { box, count };
}

// A pinhole camera of 30 degrees, in front (towards −y) and level, at 1.08 of the distance at which
// the sphere of the lights just fits. `at` and the sphere are in millimetres around the middle;
// `pitch` is that of the display's pixels.
function expectedSquare(where, [x, y, z], radius, pitch) {
  const half = Math.min(where.width, where.height) / 2;
  const focal = half / Math.tan(Math.PI / 12);
  const w = (radius / Math.sin(Math.PI / 12)) * 1.08 + y;
  const side = Math.floor((focal * pitch) / w + 0.5);
  const left = Math.floor(where.width / 2 + (focal * x) / w - side / 2 + 0.5);
  const top = Math.floor(where.height / 2 - (focal * z) / w - side / 2 + 0.5);
  return { side, box: [left, top, left + side - 1, top + side - 1] };
}

const level = "#camera=0,0,1,0,0,0";

before(async () => {
  browser = await launch();
  daemon = await Daemon.start([kCube, kRotor]);
}, { timeout: kPatience });
after(async () => {
  await browser?.close();
  await daemon?.stop();
});

describe("the page", { timeout: 5 * kPatience }, () => {
  test("asks for nothing beyond its origin, and weighs little", async () => {
    const { seen, page, context } = await open(daemon.page);
    assert.deepEqual(seen.errors, []);
    assert.ok(seen.requests.length >= 4, "page, styles, script and socket at least");
    for (const url of seen.requests) assert.equal(new URL(url).host, `127.0.0.1:${daemon.port}`, url);
    const sizes = await page.evaluate(() => performance.getEntriesByType("resource").map((entry) => entry.encodedBodySize));
    const weight = sizes.reduce((sum, size) => sum + size, 0);
    assert.ok(weight > 10_000 && weight < 400_000, `${weight} bytes`);
    await context.close();
  });

  test("a voxel is where it should be, exactly", async () => {
    await daemon.voxelctl("draw", "points vertices='3.5,8.5,12.5' color=#ffffff", "points vertices='12.5,8.5,2.5' color=#ff8000");
    const { page, context } = await open(`${daemon.page}?renderer=2d${level}`);
    assert.equal((await inspect(page)).renderer, "2D");
    await drawnPoints(page, 2);
    const image = await picture(page);
    const middle = (place) => place.map((v) => v - 8); // in a grid of 16 cells of 1 mm
    const radius = Math.hypot(7.5, 7.5, 7.5); // lights are in the middle of cells
    for (const [place, color] of [[[3.5, 8.5, 12.5], [1, 1, 1]], [[12.5, 8.5, 2.5], [1, 0x80 / 255, 0]]]) {
      const wanted = expectedSquare(image, middle(place), radius, 1);
      const found = lit(image, ([r, g, b]) => (color[2] === 0 ? b < r / 2 : b >= r / 2));
      assert.deepEqual(found.box, wanted.box);
      assert.equal(found.count, wanted.side ** 2);
      // Light fades with the distance: nothing else changes the colour.
      const [r, g, b] = at(image, wanted.box[0], wanted.box[1]);
      assert.ok(Math.abs(g - r * color[1]) <= 1 && Math.abs(b - r * color[2]) <= 1, `${r},${g},${b}`);
    }
    await context.close();
  });

  test("both renderers draw the same", async () => {
    await daemon.voxelctl("draw", "sphere radius=5 at=8,8,8 color=#40c0ff", "segments vertices='1,1,1 15,15,15' color=#ff4000");
    const software = await launch(kSoftware);
    try {
      const pictures = [];
      for (const renderer of ["2d", "gl"]) {
        const { page, seen, context } = await open(`${daemon.page}?renderer=${renderer}`, { browserOf: software });
        assert.equal((await inspect(page)).renderer, renderer === "2d" ? "2D" : "WebGL2");
        await page.waitForFunction(() => globalThis.voxeld.inspect().drawn.points > 50);
        pictures.push(await picture(page));
        const all = (await inspect(page)).drawn.points;
        await page.locator("#slice").fill("8");
        await page.waitForFunction((whole) => globalThis.voxeld.inspect().drawn.points > 0 && globalThis.voxeld.inspect().drawn.points < whole / 2, all);
        await page.uncheck("#one");
        assert.deepEqual(seen.errors, []);
        await context.close();
      }
      const [a, b] = pictures;
      assert.equal(a.width * a.height, b.width * b.height);
      let differ = 0;
      for (let i = 0; i < a.data.length; i += 4) {
        const most = Math.max(...[0, 1, 2].map((c) => Math.abs(a.data[i + c] - b.data[i + c])));
        if (most > 12) ++differ;
      }
      const { count } = lit(a);
      assert.ok(count > 2000, `${count} are lit`);
      assert.ok(differ < count * 0.05, `${differ} of ${count} differ`);
    } finally {
      await software.close();
    }
  });

  test("one slice, a slow sweep, and an address that keeps what is looked at", async () => {
    await daemon.voxelctl("draw", "box size=8,8,8 at=8,8,8 fill=solid color=white");
    const { page, context } = await open(daemon.page);
    await drawnPoints(page, 512);
    await page.locator("#slice").fill("5");
    await drawnPoints(page, 64);
    assert.ok(await page.isChecked("#one"));
    assert.equal(await page.textContent("#slice-number"), "6 of 16");
    assert.match(page.url(), /slice=5/);
    await page.locator("#slice").fill("0");
    await drawnPoints(page, 0);
    const again = await open(page.url().replace("slice=0", "slice=6"));
    await drawnPoints(again.page, 64);
    assert.equal(await again.page.inputValue("#slice"), "6");
    await again.context.close();
    await page.check("#sweep");
    await page.waitForFunction(() => [64, 128, 192].includes(globalThis.voxeld.inspect().drawn.points));
    await page.waitForFunction(() => globalThis.voxeld.inspect().drawn.points === 0);
    await page.uncheck("#sweep");
    await drawnPoints(page, 512);
    await context.close();
  });

  test("keys, mouse and wheel", async () => {
    const { page, context } = await open(daemon.page);
    const home = await page.evaluate(() => globalThis.voxeld.inspect().place(1, 2, 3));
    await page.mouse.move(300, 300);
    await page.mouse.down();
    await page.mouse.move(400, 330);
    await page.mouse.up();
    await page.mouse.wheel(0, 300);
    assert.notDeepEqual(await page.evaluate(() => globalThis.voxeld.inspect().place(1, 2, 3)), home);
    const camera = new URLSearchParams(new URL(page.url()).hash.slice(1)).get("camera").split(",").map(Number);
    assert.equal(camera[0], 24 - 40);
    assert.equal(camera[1], 20 + 12);
    assert.ok(camera[2] > 1.2);
    await page.keyboard.press("f");
    assert.match(page.url(), /camera=-16%2C32%2C1%2C/);
    await page.keyboard.press("r");
    assert.deepEqual(await page.evaluate(() => globalThis.voxeld.inspect().place(1, 2, 3)), home);
    const before = await picture(page);
    await page.keyboard.press("S");
    assert.equal(await page.isChecked("#dark"), true);
    await pictureWith(page, 0, (after) => before.data.reduce((sum, value, i) => sum + (value !== after.data[i] ? 1 : 0), 0) >= 100);
    await page.keyboard.press("s");
    assert.equal(await page.isChecked("#dark"), false);
    await context.close();
  });

  test("several displays, and several pages of one", async () => {
    await daemon.voxelctl("draw", "sphere radius=4 at=8,8,8 color=lime");
    const { page, context } = await open(daemon.page, { width: 1000 });
    const other = await open(`${daemon.page}#display=rotor`);
    assert.equal(await other.page.inputValue("#display"), "rotor");
    await page.selectOption("#display", "");
    await page.waitForFunction(() => document.querySelectorAll(".view").length === 2);
    assert.deepEqual(await page.locator(".view .label").allTextContents(), ["cube", "rotor"]);
    await page.waitForFunction(() => Number(document.getElementById("views").dataset.volume) > 0);
    await pictureWith(page, 0, (image) => lit(image).count > 100);
    await daemon.voxelctl("draw", "points vertices='8.5,8.5,8.5' color=white");
    await page.selectOption("#display", "cube");
    await drawnPoints(page, 1);
    await other.page.waitForFunction(() => globalThis.voxeld.inspect().drawn.points > 0);
    await context.close();
    await other.context.close();
  });

  test("the scene as sent stands beside what is shown, and where they differ", async () => {
    await daemon.voxelctl("draw", "box size=4,4,4 at=8,8,8 fill=solid color=white", "points vertices='1.5,1.5,1.5 14.5,1.5,1.5' color=red");
    const { page, seen, context } = await open(`${daemon.page}?renderer=2d`, { width: 1200, panel: true });
    await drawnPoints(page, 66);
    await page.keyboard.press("c");
    assert.ok(await page.isChecked("#compare"));
    const compared = (what, points) => page.waitForFunction(([key, wanted]) => globalThis.voxeld.inspect().compared[key]?.points === wanted, [what, points]);
    await compared("sent", 66);
    await compared("difference", 0);
    const labels = await page.locator(".view .label").allTextContents();
    assert.deepEqual(labels.map((label) => label.replace(/\d+/, "N")), ["cube as shown", "as sent, of volume N", "difference: blue is missing, orange too much, of volume N"]);
    assert.match(await page.textContent("#compared"), /of 66 voxels sent 0 have no light near \(0.0 %\); of 66 lit pixels 0 have no voxel near, and 0 differ/);
    // The same from the same viewpoint: here pixels are voxels. A third of the page is not a whole
    // number of screen pixels.
    const [shown, sent] = [lit(await picture(page, 0)), lit(await picture(page, 1))];
    sent.box.forEach((edge, i) => assert.ok(Math.abs(edge - shown.box[i]) <= 1, `${sent.box} and ${shown.box}`));
    assert.ok(shown.count > 1000 && Math.abs(sent.count - shown.count) < shown.count * 0.05, `${sent.count} and ${shown.count}`);

    // A scene that changes is compared again; an unselected layer is left out of what was sent, and
    // its light is then stray.
    await daemon.voxelctl("clear");
    await daemon.python("other", 'v.layer("next").box("box", size=(2, 2, 2), center=(8, 8, 8), fill="solid", color="white")');
    await compared("sent", 8);
    await page.waitForFunction(() => [...document.querySelectorAll("#layers tr")].map((row) => row.cells[1].textContent).join() === "next");
    await page.locator("#layers input").first().uncheck();
    await compared("sent", 0);
    await compared("difference", 8);
    assert.match(await page.textContent("#compared"), /8 have no voxel near/);
    await page.locator("#layers input").first().check();
    await compared("difference", 0);
    await daemon.voxelctl("clear", "--layer", "next");
    await daemon.voxelctl("draw", "sphere radius=4 at=8,8,8 color=lime");

    // Another display is selected while one is compared: the answer for that one delays nothing.
    await page.evaluate(() => document.getElementById("compare").click());
    await page.evaluate(() => document.getElementById("compare").click());
    await page.selectOption("#display", "rotor");
    await page.selectOption("#display", "cube");
    await page.selectOption("#display", "rotor");
    await page.waitForFunction(() => globalThis.voxeld.inspect().compared.sent?.points > 0);

    // With several displays, each is labelled with how far off it is.
    await page.selectOption("#display", "");
    await page.waitForFunction(() => [...document.querySelectorAll(".view .label")].every((label) => /: missing 0.0 %, stray \S+ %, off \S+ %$/.test(label.textContent)));
    assert.equal(await page.locator(".view").count(), 2);
    assert.match(page.url(), /compare=1/);
    const again = await open(page.url());
    await again.page.waitForFunction(() => /missing/.test(document.querySelector(".view .label").textContent));
    await again.context.close();
    await page.uncheck("#compare");
    await page.waitForFunction(() => document.querySelector(".view .label").textContent === "cube");
    assert.deepEqual(seen.errors, []);
    await context.close();
  });

  test("comes back when the daemon does", async () => {
    const own = await Daemon.start([kCube]);
    const { page, context } = await open(own.page);
    await own.stop({ keep: true });
    await page.waitForSelector("#offline:not([hidden])");
    const next = await Daemon.start([kCube], { port: own.port, folder: own.folder });
    try {
      await page.waitForSelector("#offline", { state: "hidden" });
      await next.voxelctl("draw", "points vertices='1.5,1.5,1.5'");
      await drawnPoints(page, 1);
    } finally {
      await context.close();
      await next.stop();
    }
  });

  test("looks unless it was given control, which an address gives once", async () => {
    const own = await Daemon.start([kCube], { terminal: true });
    try {
      assert.match(own.control ?? "", /^http:\/\/127\.0\.0\.1:\d+\/control\?key=[0-9a-f]{32}$/);
      const { page, context } = await open(own.page, { panel: true });
      assert.equal(await page.isVisible("#control"), false);
      await page.goto(own.control);
      await page.waitForSelector("#control:not([hidden])");
      assert.doesNotMatch(page.url(), /key/);
      await page.selectOption("#pattern", "TEST_PATTERN_WHITE");
      await drawnPoints(page, 16 ** 3);
      await page.check("#blank");
      await page.waitForSelector(".view.unlit");
      await page.uncheck("#blank");
      await page.waitForFunction(() => document.querySelector(".view.unlit") === null);
      const stranger = await browser.newContext();
      const refused = await (await stranger.newPage()).goto(own.control);
      assert.equal(refused.status(), 403);
      await stranger.close();
      await context.close();
    } finally {
      await own.stop();
    }
  });

  test("tells figures and layers, whatever clients call theirs", async () => {
    const name = '<img src=x onerror="globalThis.broken=1">';
    await daemon.python(name, `v.layer(${JSON.stringify(name)}).points("dot", [[8.5, 8.5, 8.5]], label=${JSON.stringify(name)})`);
    const { page, seen, context } = await open(daemon.page, { panel: true });
    await page.waitForFunction(() => /in all/.test(document.getElementById("volumes").textContent));
    await page.waitForFunction((wanted) => [...document.querySelectorAll("#layers tr")].some((row) => row.cells[1].textContent === wanted && row.cells[2].textContent === wanted), name);
    assert.equal(await page.textContent("#state"), "showing");
    assert.match(await page.textContent("#engine"), /cpu/);
    assert.equal(await page.evaluate(() => globalThis.broken), undefined);
    assert.deepEqual(seen.errors, []);
    await context.close();
  });

  for (const [name, options] of Object.entries({
    dark: { colorScheme: "dark" }, light: { colorScheme: "light" }, phone: { width: 390, height: 844, hasTouch: true, isMobile: true, colorScheme: "dark" },
  })) {
    test(`can be used by everybody: ${name}`, async () => {
      const { page, context } = await open(daemon.page, { panel: true, ...options });
      await page.waitForFunction(() => document.querySelectorAll("#layers tr").length > 0);
      const cdp = await context.newCDPSession(page);
      await cdp.send("Page.setBypassCSP", { enabled: true });
      await page.evaluate(axe.source);
      const { violations } = await page.evaluate(() => globalThis.axe.run());
      assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join(" ")}`), []);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(wide <= 0, `${wide} too wide`);
      await context.close();
    });
  }

  test("other origins and other names get nothing", async () => {
    const ask = (headers) => new Promise((resolve, reject) => {
      request({ host: "127.0.0.1", port: daemon.port, path: "/volumes", headers: {
        Connection: "Upgrade", Upgrade: "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", ...headers } })
        .on("response", (response) => resolve(response.statusCode)).on("upgrade", (response, socket) => { socket.destroy(); resolve(response.statusCode); })
        .on("error", reject).end();
    });
    assert.equal(await ask({}), 101);
    assert.equal(await ask({ Origin: `http://127.0.0.1:${daemon.port}` }), 101);
    assert.equal(await ask({ Origin: "http://evil.example" }), 403);
    assert.equal(await ask({ Host: "evil.example" }), 403);
  });
});
