// Writes licences.txt into the bundle: each package whose code, styles or files are in it, with its licence. The packages are those
// of the modules that Rollup has put together; no list is kept by hand. A package without a licence text fails the build.
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { dirname, join } from "node:path";

const FILE = "licences.txt";
const RULE = "-".repeat(80);
// What Vite itself puts into a bundle has no file.
const OF_VITE = /^\0(?:vite\/|commonjsHelpers)/;

/** The folder of the package that a module is of; none for our own. */
function folderOf(id) {
  const path = id.replace(/^\0/, "").split("?")[0] ?? "";
  if (!path.includes("/node_modules/")) return undefined;
  for (let folder = dirname(path); !folder.endsWith("/node_modules"); folder = dirname(folder)) {
    const file = join(folder, "package.json");
    // Folders within a package have files of that name without a version.
    if (existsSync(file) && JSON.parse(readFileSync(file, "utf8")).version) return folder;
  }
  throw new Error(`${path}: no package.json`);
}

/** Name, version and licence of a package. */
function noticeOf(folder) {
  const { name, version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  const files = readdirSync(folder).filter((file) => /^(licen[cs]e|copying|notice)/i.test(file)).sort();
  const texts = files.map((file) => readFileSync(join(folder, file), "utf8").replaceAll("\r\n", "\n").trim());
  // Vite lists what it is built of below its own licence: that is not in our bundle.
  const text = texts.join("\n\n").split(/\n#+ Licenses of bundled dependencies/)[0]?.trim();
  if (!text) throw new Error(`${name} ${version}: no licence text in ${folder}: do not bundle it, or ask its authors for one`);
  return { name, version, license: license ?? "see below", text };
}

/** The notices of these modules, as text. */
export function notices(modules, viteFolder) {
  const folders = new Set();
  for (const id of modules) {
    const folder = OF_VITE.test(id) ? viteFolder : folderOf(id);
    if (folder) folders.add(folder);
  }
  const all = [...folders].map(noticeOf).sort((a, b) => (a.name < b.name ? -1 : 1));
  const parts = all.map(({ name, version, license, text }) => `${RULE}\n${name} ${version}: ${license}\n${RULE}\n\n${text}\n`);
  return `The pages of Waymark contain code of these ${all.length} packages, under their licences.\n\n${parts.join("\n")}`;
}

/** The plugin of Vite. */
export function licences() {
  let root = "";
  return {
    name: "licences",
    configResolved(config) {
      root = config.root;
    },
    generateBundle(_options, bundle) {
      const modules = new Set([...this.getModuleIds()].filter((id) => /\.css(?:\?|$)/.test(id)));
      for (const part of Object.values(bundle)) {
        if (part.type !== "chunk") {
          for (const name of part.originalFileNames ?? []) if (name.includes("node_modules/")) modules.add(join(root, name));
          continue;
        }
        for (const [id, module] of Object.entries(part.modules)) if (module.renderedLength > 0) modules.add(id);
      }
      const source = notices(modules, join(root, "node_modules/vite"));
      this.emitFile({ type: "asset", fileName: FILE, source });
    },
  };
}
