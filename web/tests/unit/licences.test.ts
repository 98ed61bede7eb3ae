// The notices of what is in the bundle are made of its modules, each with its text.
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { expect, test } from "vitest";
// @ts-expect-error: a tool without types
import { notices } from "../../tools/licences.js";

const root = new URL("../..", import.meta.url).pathname;
const text = (path: string) => readFileSync(join(root, path), "utf8");

test("the notices that are served name every package that the pages are made of, with a text", () => {
  const served = text("dist/licences.txt");
  const { dependencies } = JSON.parse(text("package.json")) as { dependencies: Record<string, string> };
  for (const [name, version] of Object.entries(dependencies)) expect(served).toContain(`\n${name} ${version}: `);
  const parts = served.split(/^-{80}$/m).slice(1);
  expect(parts.length).toBe(2 * Number(/code of these (\d+) packages/.exec(served)?.[1]));
  for (const [i, part] of parts.entries()) if (i % 2) expect(part).toMatch(/copyright|licen[cs]e/i);
});

test("notices are of the packages of modules, each once, and of nothing else", () => {
  const folder = mkdtempSync(join(tmpdir(), "waymark-licences-"));
  try {
    const put = (path: string, content: string) => {
      mkdirSync(join(folder, path, ".."), { recursive: true });
      writeFileSync(join(folder, path), content);
    };
    const pack = (name: string, file?: string) => {
      put(`node_modules/${name}/package.json`, JSON.stringify({ name, version: "1.2.3", license: "MIT" }));
      if (file) put(`node_modules/${name}/${file}`, `Copyright of ${name}\r\nMIT\n# Licenses of bundled dependencies\nmore`);
    };
    pack("@a/b", "LICENSE.md");
    pack("c", "licence");
    pack("vite", "LICENSE");
    pack("without");
    // A folder of a package with a file of that name, as some have for both kinds of modules.
    put("node_modules/c/esm/package.json", JSON.stringify({ type: "module" }));
    const at = (path: string) => join(folder, "node_modules", path);
    const modules = [at("c/esm/x.js"), at("c/y.css?inline"), at("@a/b/z.js"), "\0vite/preload-helper.js", join(folder, "src/own.ts"), "\0own"];
    const made = notices(modules, at("vite"));
    expect([...made.matchAll(/^(\S+) 1\.2\.3: MIT$/gm)].map(([, name]) => name)).toEqual(["@a/b", "c", "vite"]);
    expect(made).toContain("Copyright of c\nMIT\n");
    expect(made).not.toContain("more");
    expect(() => notices([at("without/x.js")], at("vite"))).toThrow("without 1.2.3: no licence text");
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
});
