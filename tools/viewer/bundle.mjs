// Bundles the page: TypeScript and styles from src/ into --out, each file compressed with gzip, with the libraries in
// --modules. esbuild reports which of these are included: modules.json.
import { createRequire } from "node:module";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { gzipSync } from "node:zlib";

const { values } = parseArgs({ options: { modules: { type: "string" }, out: { type: "string" } } });
if (!values.modules || !values.out) {
  console.error("usage: bundle.mjs --modules NODE_MODULES --out FOLDER");
  process.exit(2);
}
const esbuild = createRequire(join(resolve(values.modules), "x"))("esbuild");
const source = join(dirname(fileURLToPath(import.meta.url)), "src");
const built = await esbuild.build({
  entryPoints: [join(source, "page.ts"), join(source, "splat_worker.ts"), join(source, "page.css")],
  outdir: values.out,
  bundle: true,
  minify: true,
  write: false,
  format: "esm",
  target: ["es2022"],
  legalComments: "eof",
  nodePaths: [resolve(values.modules)],
  logLevel: "warning",
  metafile: true,
});
mkdirSync(values.out, { recursive: true });
const files = built.outputFiles.map((file) => [file.path.slice(file.path.lastIndexOf("/") + 1), Buffer.from(file.contents)]);
files.push(["index.html", readFileSync(join(source, "index.html"))]);
for (const [name, contents] of files) writeFileSync(join(values.out, `${name}.gz`), gzipSync(contents, { level: 9 }));
const bundled = new Set();
for (const output of Object.values(built.metafile.outputs)) {
  for (const [input, { bytesInOutput }] of Object.entries(output.inputs)) {
    const name = input.match(/.*node_modules\/((?:@[^/]+\/)?[^/]+)\//)?.[1];
    if (name && bytesInOutput > 0) bundled.add(name);
  }
}
writeFileSync(join(values.out, "modules.json"), `${JSON.stringify([...bundled].sort())}\n`);
