// What docs/guides/administrator.md names is on the pages, and its pictures are those of the journeys.
import { existsSync, readFileSync, readdirSync } from "node:fs";
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

test("every picture is there, and a journey takes it", () => {
  const pictures = [...guide.matchAll(/pictures\/pages\/([a-z-]+)\.png/g)].map((found) => found[1] ?? "");
  const taken = readFileSync("tests/journeys/harness.js", "utf8");
  expect(pictures.length).toBeGreaterThan(3);
  expect(pictures.filter((name) => !taken.includes(`"${name}"`) || !existsSync(`../docs/pictures/pages/${name}.png`))).toEqual([]);
});
