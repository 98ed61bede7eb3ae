// What docs/TESTING.md says of the pages is shown by tests that exist.
import { readFileSync, readdirSync } from "node:fs";
import { expect, test } from "vitest";

const text = /^## Pages\n(.*?)(?=^## )/ms.exec(readFileSync("../docs/TESTING.md", "utf8"))?.[1] ?? "";
const rows = [...text.matchAll(/^\| ([AF]\d+(?:, [AF]\d+)*) \| ([^|]+) \| ([^|]+) \|$/gm)].map(([, number = "", what = "", journeys = ""]) => ({ number, what, journeys }));

/** Names of the tests of a file. The same journey at a desk and on a phone has one name here. */
function testsOf(file: string): string[] {
  const source = readFileSync(`tests/${file.endsWith(".js") ? "journeys" : "unit"}/${file}`, "utf8");
  return [...source.matchAll(/^\s*test\((?:"([^"]+)"|`([^`]+)`)/gm)].map(([, plain, both]) => (plain ?? both ?? "").replace(/, at the \$\{where\}$/, ""));
}

test("the tables have the 16 tasks and the 26 features", () => {
  const numbered = (letter: string, most: number) => Array.from({ length: most }, (_, i) => `${letter}${i + 1}`);
  const numbers = rows.flatMap(({ number }) => number.split(", "));
  expect(numbers.length).toBe(42);
  expect(new Set(numbers)).toEqual(new Set([...numbered("A", 16), ...numbered("F", 26)]));
  expect(new Set(rows.map(({ what }) => what)).size).toBe(rows.length);
});

test("every test that the tables name exists", () => {
  const missing = rows.flatMap(({ number, journeys }) => {
    if (journeys === "later") return [];
    return journeys.split("; ").reduce<string[]>((parts, part) => {
      // A name may have a semicolon itself: it goes on until its file.
      const open = parts.at(-1);
      if (open !== undefined && !open.endsWith("`)")) parts[parts.length - 1] = `${open}; ${part}`;
      else parts.push(part);
      return parts;
    }, []).flatMap((named) => {
      const [, name = "", file = ""] = /^(.*) \(`([^`]+)`\)$/.exec(named) ?? [];
      return file && testsOf(file).includes(name) ? [] : [`${number}: ${named}`];
    });
  });
  expect(missing).toEqual([]);
  expect(rows.filter(({ journeys }) => journeys === "later").map(({ number }) => number)).toEqual(["F20"]);
});

test("every journey has a name of its own", () => {
  const names = readdirSync("tests/journeys").filter((file) => file.endsWith(".test.js")).flatMap((file) => testsOf(file));
  expect(names.length).toBeGreaterThan(40);
  expect(names.filter((name, i) => names.indexOf(name) !== i)).toEqual([]);
});
