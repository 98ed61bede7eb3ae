// Changes of one kind that follow one another are one row of the history.
import { expect, test } from "vitest";
import type { Commit } from "../../src/api/types";
import { landmarksOf, runsOf } from "../../src/words/runs";

const commit = (id: number, operation: string, author = "ann", why?: string): Commit =>
  ({ id, operation, author, created_ms: id, why: why ?? null, summary: { landmarks: [`door-${id % 2}`] } }) as unknown as Commit;

test("four of one kind by one author are one, three or those with a reason are not", () => {
  const commits = [commit(9, "learn"), ...[8, 7, 6, 5].map((id) => commit(id, "add")), ...[4, 3].map((id) => commit(id, "add", "bob")), commit(2, "add", "bob", "because"), commit(1, "add", "bob")];
  const runs = runsOf(commits);
  expect(runs.map((run) => run.map(({ id }) => id))).toEqual([[9], [8, 7, 6, 5], [4], [3], [2], [1]]);
  expect(landmarksOf(runs[1] ?? [])).toEqual(["door-0", "door-1"]);
});
