// What is generated of documents must be of the present ones.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import rights from "../../src/api/rights.json";
// @ts-expect-error: a tool without types
import { rights as fresh } from "../../tools/rights.js";

test("types are those of the OpenAPI document: npm run types writes them", () => {
  const made = execFileSync("npx", ["openapi-typescript", "../docs/openapi.json"], { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
  expect(readFileSync("src/api/schema.d.ts", "utf8") === made).toBe(true);
}, 60_000);

test("rights are those of docs/AUTHORISATION.md: npm run types writes them", () => {
  expect(rights).toEqual(fresh());
  expect(Object.keys(rights).length).toBeGreaterThan(100);
});
