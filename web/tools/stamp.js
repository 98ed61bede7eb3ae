// Writes dist/sources.sha256: the digest of everything that the pages are built of. A test of the server compares it with
// the sources (server/src/http/pages.rs), so that old pages are not served; `--check` does it at once.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const root = new URL("..", import.meta.url).pathname;
const BUILT_OF = ["index.html", "package.json", "package-lock.json", "public", "src", "svelte.config.js", "tools/licences.js", "tsconfig.json", "vite.config.ts"];

function files(path) {
  if (!statSync(root + path).isDirectory()) return [path];
  return readdirSync(root + path).flatMap((name) => files(`${path}/${name}`));
}

const digest = createHash("sha256");
for (const path of BUILT_OF.flatMap(files).sort()) {
  const content = createHash("sha256").update(readFileSync(root + path)).digest("hex");
  digest.update(`${content}  ${path}\n`);
}
const stamp = `${digest.digest("hex")}\n`;
if (process.argv.includes("--check")) {
  if (readFileSync(`${root}dist/sources.sha256`, "utf8") === stamp) process.exit();
  console.error("web/dist is older than its sources: npm run build in web, and commit web/dist");
  process.exit(1);
}
writeFileSync(`${root}dist/sources.sha256`, stamp);

const scripts = files("dist/assets").filter((path) => path.endsWith(".js"));
const bytes = scripts.map((path) => gzipSync(readFileSync(root + path)).length);
console.log(`${scripts.length} scripts, ${(bytes.reduce((sum, n) => sum + n, 0) / 1000).toFixed(0)} kB compressed`);
