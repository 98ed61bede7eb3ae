// What is generated of documents must be of the present ones, and a client of the whole document compiles.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { expect, test } from "vitest";
import rights from "../../src/api/rights.json";
// @ts-expect-error: a tool without types
import { rights as fresh } from "../../tools/rights.js";
// @ts-expect-error: a tool without types
import { types, whole } from "../../tools/types.js";

/** Most lines of the generated types. */
const MOST_LINES = 2500;

test("types are those of the OpenAPI document: npm run types writes them", async () => {
  const kept = readFileSync("src/api/schema.d.ts", "utf8");
  expect(kept === (await types())).toBe(true);
  expect(kept.split("\n").length).toBeLessThanOrEqual(MOST_LINES);
}, 60_000);

test("rights are those of docs/AUTHORISATION.md: npm run types writes them", () => {
  expect(rights).toEqual(fresh());
  expect(Object.keys(rights).length).toBeGreaterThan(100);
});

/** Uses operations by id, a refusal among them. */
const CLIENT = `import type { components, operations } from "./document";
type Json<T> = T extends { content: { "application/json": infer B } } ? B : never;
export type Maps = Json<operations["listMaps"]["responses"][200]>;
export type Made = Json<operations["createLandmark"]["responses"][201]>;
export const first = (maps: Maps): string | undefined => maps.items[0]?.name;
export const place = (made: Made): components["schemas"]["Place"] | null | undefined => made.place;
export const code = (refused: operations["getRobot"]["responses"][404]["content"]["application/problem+json"]): string => refused.code;
`;

test("a client of the whole document compiles, and so do the types that it is made of", async () => {
  const folder = mkdtempSync(join(tmpdir(), "client-"));
  try {
    writeFileSync(join(folder, "document.d.ts"), await whole());
    writeFileSync(join(folder, "client.ts"), CLIENT);
    const flags = ["--noEmit", "--strict", "--noUncheckedIndexedAccess", "--skipLibCheck", "false", "--target", "es2022", "--module", "esnext", "--moduleResolution", "bundler"];
    const compiler = resolve("node_modules/typescript/bin/tsc");
    const { stdout } = spawnSync(process.execPath, [compiler, ...flags, "client.ts"], { cwd: folder, encoding: "utf8" });
    expect(stdout).toBe("");
  } finally {
    rmSync(folder, { recursive: true });
  }
}, 60_000);
