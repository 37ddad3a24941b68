// A voxeld for one test, with a page, and voxelctl to draw into it. Paths are in VOXELD, VOXELCTL
// and WHEEL.
import { execFile, spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";

const run = promisify(execFile);

export async function freePort() {
  const server = createServer();
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const { port } = server.address();
  await new Promise((resolve) => server.close(resolve));
  return port;
}

export class Daemon {
  // `displays`: as after --display. `terminal`: its output is a terminal, so it prints the address
  // that gives control. `config`: the text of a configuration file. `listen`: replaces the Unix
  // socket.
  static async start(displays, { terminal = false, port, folder, config, listen } = {}) {
    const daemon = new Daemon();
    daemon.displays = displays;
    daemon.port = port ?? (await freePort());
    daemon.folder = folder ?? mkdtempSync(join(tmpdir(), "voxeld-page-"));
    daemon.server = `unix:${daemon.folder}/voxeld.sock`;
    if (config !== undefined) writeFileSync(`${daemon.folder}/voxeld.toml`, config);
    const command = [process.env.VOXELD, ...(config === undefined ? [] : ["--config", `${daemon.folder}/voxeld.toml`]), "--listen", listen ?? daemon.server, "--http", `127.0.0.1:${daemon.port}`, "--log-level", "warn", "--engine", "cpu",
      ...displays.flatMap((display) => ["--display", display])];
    const quoted = command.map((word) => `'${word}'`).join(" ");
    daemon.process = terminal
      ? spawn("script", ["-qfec", quoted, "/dev/null"], { stdio: ["ignore", "pipe", "inherit"] })
      : spawn(command[0], command.slice(1), { stdio: ["ignore", "pipe", "inherit"] });
    daemon.output = "";
    daemon.ended = new Promise((resolve) => daemon.process.on("exit", resolve));
    await new Promise((resolve, reject) => {
      daemon.process.stdout.on("data", (text) => {
        daemon.output += text;
        if (/^engine: [^\n]*\n/m.test(daemon.output)) resolve();
      });
      daemon.process.on("exit", (code) => reject(new Error(`voxeld ended with ${code}:\n${daemon.output}`)));
    });
    return daemon;
  }

  get page() {
    return `http://127.0.0.1:${this.port}/`;
  }

  // Returns the address that gives control, as printed on a terminal.
  get control() {
    return /http:\S*\/control\?key=[0-9a-f]+/.exec(this.output)?.[0];
  }

  async voxelctl(...words) {
    return (await run(process.env.VOXELCTL, ["--server", this.server, ...words], { maxBuffer: 1 << 26 })).stdout;
  }

  // Runs a client with another name, whose layers stay: Python, connected as `v`. WHEEL is where
  // its module is.
  async python(name, code) {
    const program = `import voxeld\nwith voxeld.connect("${this.server}", name=${JSON.stringify(name)}, on_disconnect="keep") as v:\n${code.replace(/^/gm, "    ")}\n    v.commit().wait_shown(timeout=60)\n`;
    await run("/usr/bin/python3", ["-c", program], { env: { ...process.env, PYTHONPATH: process.env.WHEEL } });
  }

  async stop({ keep = false } = {}) {
    this.process.kill("SIGTERM");
    await this.ended;
    if (!keep) rmSync(this.folder, { recursive: true, force: true });
  }
}
