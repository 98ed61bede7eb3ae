// What docs/TESTING.md says of the pages is shown by tests that exist.
import { readFileSync, readdirSync } from "node:fs";
import { expect, test } from "vitest";

const text = /^## Pages\n(.*?)(?=^## )/ms.exec(readFileSync("../docs/TESTING.md", "utf8"))?.[1] ?? "";
const rows = [...text.matchAll(/^\| (A\d+(?:, A\d+)*) \| ([^|]+) \| ([^|]+) \|$/gm)].map(([, number = "", what = "", journeys = ""]) => ({ number, what, journeys }));

/** Names of the tests of a file. The same journey at a desk and on a phone has one name here. */
function testsOf(file: string): string[] {
  const source = readFileSync(`tests/${file.endsWith(".js") ? "journeys" : "unit"}/${file}`, "utf8");
  return [...source.matchAll(/^\s*test\((?:"([^"]+)"|`([^`]+)`)/gm)].map(([, plain, both]) => (plain ?? both ?? "").replace(/, at the \$\{where\}$/, ""));
}

test("the table has the 16 tasks", () => {
  const numbers = rows.flatMap(({ number }) => number.split(", "));
  expect(numbers.length).toBe(16);
  expect(new Set(numbers)).toEqual(new Set(Array.from({ length: 16 }, (_, i) => `A${i + 1}`)));
  expect(new Set(rows.map(({ what }) => what)).size).toBe(rows.length);
});

test("every test that the table names exists", () => {
  const missing = rows.flatMap(({ number, journeys }) => {
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
});

test("every journey has a name of its own", () => {
  const names = readdirSync("tests/journeys").filter((file) => file.endsWith(".test.js")).flatMap((file) => testsOf(file));
  expect(names.length).toBeGreaterThan(40);
  expect(names.filter((name, i) => names.indexOf(name) !== i)).toEqual([]);
});
