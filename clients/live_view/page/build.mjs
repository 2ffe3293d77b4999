// node build.mjs OUTPUT [ROOT DOCUMENTS]: bundles the page into OUTPUT/page.js, copies what needs no bundling, and makes
// OUTPUT/help.html of the documents (separated by commas, from ROOT on).
import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { helpOf } from "./help.mjs";

const [output, root = "", documents = ""] = process.argv.slice(2);
mkdirSync(output, { recursive: true });
await build({
  entryPoints: ["src/main.ts"],
  outfile: `${output}/page.js`,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  legalComments: "eof", // three.js is MIT: its notice stays; uPlot's has no mark that esbuild knows
  footer: { js: "/*! uPlot: Copyright (c) Leon Sorokin, MIT license */" },
  logLevel: "warning",
});
copyFileSync("index.html", `${output}/index.html`);
writeFileSync(`${output}/page.css`, readFileSync("node_modules/uplot/dist/uPlot.min.css", "utf8") + readFileSync("page.css", "utf8"));
writeFileSync(`${output}/help.html`, helpOf(root, documents.split(",").filter(Boolean)));
