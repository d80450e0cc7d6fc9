// Bundles `source` and three.js into viewer.min.js: npm ci && npm run build

import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";
import { build } from "esbuild";

const hash = createHash("sha256");
for (const name of readdirSync("source").sort()) hash.update(readFileSync(`source/${name}`));
const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();

await build({
  entryPoints: ["source/main.js"],
  outfile: "viewer.min.js",
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  // The comments of other files are within the licence.
  legalComments: "none",
  banner: { js: `/* Built by build.js from source ${hash.digest("hex")}\n\nIt contains three.js:\n\n${licence}\n*/` },
});
