// Drawing walls: what a click snaps to; and the lines of a plan that are offered as walls.
import { expect, test } from "vitest";
import { type Point, crossing } from "../../src/map/geometry";
import type { PlanInk } from "../../src/map/plan-ink";
import { lineAt, planLines } from "../../src/map/plan-walls";
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

/** A plan of 2 m by 1 m, 1 cm a pixel. */
function planOf(draw: (dark: (x: number, y: number) => void) => void): { grey: Uint8Array; width: number; height: number } {
  const [width, height] = [200, 100];
  const grey = new Uint8Array(width * height).fill(255);
  draw((x, y) => (grey[y * width + x] = 0));
  return { grey, width, height };
}

test("an oblique line of a plan is followed along its middle, and a crossing, a blot and bare paper are no line", () => {
  const { grey, width, height } = planOf((dark) => {
    for (let x = 0; x < 100; x++) for (let k = -2; k <= 2; k++) dark(x, 10 + Math.floor(x / 2) + k);
    for (let x = 120; x < 150; x++) for (let y = 20; y < 50; y++) dark(x, y);
    for (let i = 0; i < 60; i++) for (let k = 0; k < 3; k++) [dark(130 + i, 80 + k), dark(160 + k, 55 + (i % 45))];
  });
  const found = lineAt(grey, width, height, [50, 40], 12);
  const [u, v] = found ?? [0, 0];
  expect(Math.abs(v - (10.5 + u / 2))).toBeLessThan(0.5);
  // The foot of the perpendicular, so that what is drawn follows the hand.
  expect(Math.abs((u - 50) * 2 + (v - 40))).toBeLessThan(1);
  expect(lineAt(grey, width, height, [135, 35], 12)).toBeUndefined();
  expect(lineAt(grey, width, height, [161, 81], 12)).toBeUndefined();
  expect(lineAt(grey, width, height, [20, 80], 12)).toBeUndefined();
});

test("a wall that is drawn beside a line of the plan lies on it, and a right angle that is along it stays square", () => {
  const ink = { corner: () => undefined, line: ([x, y]: Point): Point | undefined => (Math.abs(y - (1 + 0.02 * x)) < 0.2 ? [x, 1 + 0.02 * x] : undefined), lines: () => [] };
  const editor = new WallEditor([], "1", ink as unknown as PlanInk);
  editor.click([0, 1.1], PX_M);
  expect(editor.from).toEqual([0, 1]);
  // Far along, the line of the plan is not at a right angle to the axes any more: the plan counts.
  expect(editor.snapped([5, 1.15], PX_M)).toEqual([5, 1.1]);
  // Near by, both agree within the thickness of the line.
  expect(editor.snapped([1, 1.02], PX_M)[1]).toBeCloseTo(1, 12);
});

test("lines meet in a corner, also where each ends half a thickness before it", () => {
  expect(crossing([[0, 0], [4, 0]], [[4.05, 0.05], [4.05, 3]], 0.1)).toEqual([4.05, 0]);
  expect(crossing([[0, 0], [4, 0]], [[4.5, 0.05], [4.5, 3]], 0.1)).toBeUndefined();
  expect(crossing([[0, 0], [4, 0]], [[0, 1], [4, 1]], 0.1)).toBeUndefined();
});
