// node build.mjs OUTPUT: bundles the page into OUTPUT/page.js and copies what needs no bundling.
import { build } from "esbuild";
import { copyFileSync, mkdirSync } from "node:fs";

const output = process.argv[2];
mkdirSync(output, { recursive: true });
await build({
  entryPoints: ["src/main.ts"],
  outfile: `${output}/page.js`,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  legalComments: "eof", // three.js is MIT: its notice stays
  logLevel: "warning",
});
for (const file of ["index.html", "page.css"]) copyFileSync(file, `${output}/${file}`);
