// Changes that follow one another and are of one kind, as one. In: commits, the newest first. Out: runs of them in that order.
import type { Commit } from "../api/types";

/** So many and more are shown as one; fewer one by one. */
const LEAST = 4;

/** Runs of commits of one operation by one author, without words of their own; all others are alone. */
export function runsOf(commits: readonly Commit[]): Commit[][] {
  const runs: Commit[][] = [];
  for (const commit of commits) {
    const last = runs.at(-1);
    const one = last?.[0];
    if (last && one && !one.why && !commit.why && one.operation === commit.operation && one.author === commit.author) last.push(commit);
    else runs.push([commit]);
  }
  return runs.flatMap((run) => (run.length < LEAST ? run.map((commit) => [commit]) : [run]));
}

/** The landmarks of a run, each once. */
export const landmarksOf = (run: readonly Commit[]): string[] => [...new Set(run.flatMap(({ summary }) => summary.landmarks))];
