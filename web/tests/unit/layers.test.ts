import { expect, test } from "vitest";
import { LAYERS, layersOf, moved, queryOf } from "../../src/map/layers";

const names = (query: string) => layersOf(new URLSearchParams(query)).map(({ name }) => name);
const USUAL = LAYERS.map(({ name }) => name);

test("a new view has the usual order, and its address says nothing of layers", () => {
  const layers = layersOf(new URLSearchParams());
  expect(names("")).toEqual(USUAL);
  expect(layers.filter(({ is_on }) => !is_on).map(({ name }) => name)).toEqual(["tracks"]);
  expect(queryOf(layers)).toEqual({ off: undefined, order: undefined });
});

test("an order is moved, kept in the address, and read again", () => {
  const layers = moved(layersOf(new URLSearchParams()), "walls", 1);
  expect(layers.map(({ name }) => name)).toEqual(["plan", "landmarks", "walls", "tracks", "robots"]);
  const { order } = queryOf(layers);
  expect(order).toBe("plan.landmarks.walls.tracks.robots");
  expect(names(`order=${order}`)).toEqual(layers.map(({ name }) => name));
});

test("what is at the end stays there", () => {
  expect(moved(LAYERS, "robots", 1)).toEqual(LAYERS);
  expect(moved(LAYERS, "plan", -1)).toEqual(LAYERS);
});

test("an address with other, missing or repeated names still has every layer once", () => {
  expect(names("order=robots.nosuch.robots.plan")).toEqual(["robots", "plan", "walls", "landmarks", "tracks"]);
  for (const query of ["order=walls", "order=..", "order=tracks.robots"]) expect(names(query).sort()).toEqual([...USUAL].sort());
  expect(layersOf(new URLSearchParams("off=none")).every(({ is_on }) => is_on)).toBe(true);
});
