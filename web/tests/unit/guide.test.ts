// What docs/guides/administrator.md names is on the pages, and its pictures are those of the journeys.
import { readFileSync, readdirSync, statSync } from "node:fs";
import { expect, test } from "vitest";

const guide = readFileSync("../docs/guides/administrator.md", "utf8");

function sources(folder: string): string[] {
  return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const path = `${folder}/${entry.name}`;
    return entry.isDirectory() ? sources(path) : path.endsWith(".svelte") ? [readFileSync(path, "utf8")] : [];
  });
}

test("every word in bold is on a page", () => {
  const bold = [...guide.matchAll(/\*\*([^*]+)\*\*/g)].map((found) => found[1]?.replace(/\s+/g, " ") ?? "");
  expect(bold.length).toBeGreaterThan(5);
  const pages = sources("src").join("\n");
  expect(bold.filter((word) => !pages.includes(`>${word}<`) && !pages.includes(`> ${word}<`) && !pages.includes(`title: "${word}"`))).toEqual([]);
});

test("every picture is there and small, a journey takes it, and there is no other", () => {
  const pictures = [...guide.matchAll(/pictures\/pages\/([a-z-]+)\.webp/g)].map((found) => found[1] ?? "");
  expect(pictures.length).toBeGreaterThan(50);
  const stored = readdirSync("../docs/pictures/pages").map((file) => file.replace(".webp", ""));
  expect(stored.sort()).toEqual([...pictures].sort());
  expect(pictures.filter((name) => statSync(`../docs/pictures/pages/${name}.webp`).size > 60_000)).toEqual([]);
  const script = (JSON.parse(readFileSync("package.json", "utf8")) as { scripts: { pictures: string } }).scripts.pictures;
  const journeys = [...script.matchAll(/tests\/journeys\/\S+/g)].map(([file]) => readFileSync(file, "utf8")).join("\n");
  const taken = (name: string) => {
    const [, page, where] = /^(.*?)(-desk|-phone)?$/.exec(name) ?? [];
    return journeys.includes(where ? `\`${page}-\${where}\`` : `"${name}"`) || new RegExp(`^ {2}\\["${page}", "/`, "m").test(journeys);
  };
  expect(pictures.filter((name) => !taken(name))).toEqual([]);
});
