// Every page has its help, and what it leads to is in docs.
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { expect, test } from "vitest";
import { rendered, slug } from "../../src/pages/help/rendered";
import { GUIDES, HELP } from "../../src/words/help";

const routes = [...readFileSync("src/routes.svelte.ts", "utf8").matchAll(/route\("([^"]+)"/g)].map((found) => found[1] ?? "");
const patterns = Object.keys(HELP);
const fileOf = (name: string) => [`../docs/guides/${name}.md`, `../docs/${name}.md`].find(existsSync) ?? "";

test("every page has its help, and there is no help of a page that is not there", () => {
  expect(routes.length).toBeGreaterThan(15);
  expect([...new Set(patterns.map((pattern) => pattern.split("?")[0]))].sort()).toEqual([...routes].sort());
  const parts = (file: string) => [...readFileSync(file, "utf8").matchAll(/\{ name: "(\w+)", title/g)].map((found) => found[1]);
  expect(parts("src/pages/admin/Admin.svelte").map((part) => `/admin?part=${part}`).filter((part) => !HELP[part])).toEqual([]);
  expect(parts("src/pages/settings/MapSettings.svelte").map((part) => `/maps/:map/settings?part=${part}`).filter((part) => !HELP[part])).toEqual([]);
});

test("a journey opens every page, takes its picture and reads its help", () => {
  const journey = [...readFileSync("tests/journeys/pages.test.js", "utf8").matchAll(/^ {2}\["([a-z-]+)", "([^"]+)"/gm)];
  expect(journey.map(([, , pattern]) => pattern).sort()).toEqual([...patterns].sort());
  const guide = readFileSync("../docs/guides/administrator.md", "utf8");
  const named = journey.flatMap(([, name]) => [`${name}-desk`, `${name}-phone`]);
  expect(named.filter((name) => !guide.includes(`(../pictures/pages/${name}.webp)`))).toEqual([]);
});

test("every guide that help leads to is there, with the section, and all guides are listed", () => {
  const missing = Object.entries(HELP).filter(([, { guide }]) => {
    const [name = "", section] = guide.split("#");
    const headings = [...readFileSync(fileOf(name), "utf8").matchAll(/^#+ (.*)$/gm)].map((found) => slug(found[1] ?? ""));
    return section !== undefined && !headings.includes(section);
  });
  expect(missing).toEqual([]);
  const listed = GUIDES.flatMap(({ guides }) => guides.map(({ name }) => name));
  expect(readdirSync("../docs/guides").map((file) => file.replace(".md", "")).filter((name) => !listed.includes(name))).toEqual([]);
  const embedded = readFileSync("../server/build.rs", "utf8");
  expect(listed.filter((name) => !existsSync(`../docs/guides/${name}.md`) && !embedded.includes(`"${name}.md"`))).toEqual([]);
  const titles = GUIDES.flatMap(({ guides }) => guides).filter(({ name }) => existsSync(`../docs/guides/${name}.md`));
  expect(titles.filter(({ name, title }) => !readFileSync(fileOf(name), "utf8").startsWith(`# ${title}\n`)).map(({ name }) => name)).toEqual([]);
});

test("links of a guide lead to what is served, pictures are left out, and what is code stays code", () => {
  const { html, sections } = rendered("# One\n\n## What `a` is, in 2 words\n\nSee [two](history.md#steps), [three](../API.md), [four](../method/09-gates.md), [here](#one).\n\n![a](../pictures/a.webp)\n\n```sh\nls <b>\n```\n\n| a | b |\n|---|---|\n| 1 | 2 |\n");
  expect(html).toContain('<h2 id="what-a-is-in-2-words">What <code>a</code> is, in 2 words</h2>');
  expect(html).toContain('See <a href="/help/history#steps">two</a>, <a href="/help/API">three</a>, four, <a href="#one">here</a>.');
  expect(html).not.toContain("<img");
  expect(html).toContain('<pre tabindex="0"><code class="language-sh">ls &lt;b&gt;');
  expect(html).toContain('<div class="wide" tabindex="0"><table>');
  expect(sections).toEqual([{ title: "What a is, in 2 words", place: "what-a-is-in-2-words" }]);
});
