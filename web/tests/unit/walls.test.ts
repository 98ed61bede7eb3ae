// Drawing walls: what a click snaps to; and the lines of a plan that are offered as walls.
import { expect, test } from "vitest";
import { planLines } from "../../src/map/plan-walls";
import { WallEditor } from "../../src/map/wall-editor.svelte";

const PX_M = 0.01;

test("a corner is square, ends meet, and a line that comes back to a wall is done", () => {
  const editor = new WallEditor([], "1");
  editor.click([0, 0], PX_M);
  editor.click([4, 0.2], PX_M);
  editor.click([4.1, 3], PX_M);
  editor.click([0.1, 3.05], PX_M);
  editor.click([0.05, 0.05], PX_M);
  const rounded = editor.segments.map(({ a, b }) => [...a, ...b].map((value) => Math.round(value * 1000) / 1000 + 0));
  expect(rounded).toEqual([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]]);
  expect(editor.from).toBeUndefined();
  expect(editor.difference).toEqual({ added: 4, removed: 0 });
});

test("a new wall begins on the wall that is clicked, and an oblique one stays oblique", () => {
  const editor = new WallEditor([{ a: [0, 0], b: [4, 0] }], "1");
  editor.click([2, 0.1], PX_M);
  expect(editor.from).toEqual([2, 0]);
  editor.click([3, 1], PX_M);
  expect(editor.segments[1]).toEqual({ a: [2, 0], b: [3, 1] });
});

test("the chosen wall is moved, its end is moved, it is removed, and each step can be taken back", () => {
  const editor = new WallEditor([{ a: [0, 0], b: [4, 0], covariance: [1, 0, 1] }, { a: [0, 5], b: [4, 5] }], "1");
  editor.use("choose");
  editor.click([2, 0.05], PX_M);
  expect(editor.chosen).toBe(0);
  editor.drag([2, 0], [2, 0.5], true, false, PX_M);
  editor.drag([2, 0], [2, 1], false, true, PX_M);
  // It was moved by hand: how well scans knew it is not so any more.
  expect(editor.segments[0]).toEqual({ a: [0, 1], b: [4, 1] });
  editor.drag([4, 1], [4, 2], true, false, PX_M);
  editor.drag([4, 1], [4, 4.95], false, true, PX_M);
  expect(editor.segments[0]).toEqual({ a: [0, 1], b: [4, 5] });
  editor.remove();
  expect(editor.segments).toHaveLength(1);
  editor.undo();
  editor.undo();
  editor.undo();
  expect(editor.segments[0]).toEqual({ a: [0, 0], b: [4, 0], covariance: [1, 0, 1] });
  expect([editor.is_changed, editor.can_undo]).toEqual([false, false]);
});

test("straight lines of a plan are found with their thickness taken out; letters and filled areas are none", () => {
  const [width, height] = [200, 100];
  const grey = new Uint8Array(width * height).fill(255);
  const fill = (x: number, y: number, w: number, h: number) => {
    for (let v = y; v < y + h; v++) grey.fill(0, v * width + x, v * width + x + w);
  };
  fill(10, 20, 150, 4);
  fill(10, 20, 4, 70);
  fill(100, 50, 8, 8);
  fill(120, 40, 40, 40);
  const found = planLines(grey, width, height, 30);
  expect(found).toEqual([{ a: [10, 22], b: [160, 22] }, { a: [12, 20], b: [12, 90] }]);
});
