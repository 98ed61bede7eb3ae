// Writes src/api/rights.json of docs/AUTHORISATION.md: the least role of each operation, and whether it needs a token for
// all maps. Pages show no button that the server would refuse.
import { readFileSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

export function rights() {
  const text = readFileSync(new URL("../../docs/AUTHORISATION.md", import.meta.url), "utf8");
  const rows = text.matchAll(/^\| `([A-Z]+ [^`]+)` \| (\w+) \| (\w*) \|$/gm);
  return Object.fromEntries([...rows].map(([, operation, role, scope]) => [operation, { role, scope }]));
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  writeFileSync(new URL("../src/api/rights.json", import.meta.url), `${JSON.stringify(rights(), null, 1)}\n`);
}
