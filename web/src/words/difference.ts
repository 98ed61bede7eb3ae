// How two versions of a map differ, in words.
import type { components } from "../api/schema";
import { count } from "./amounts";

type Summary = components["schemas"]["ChangeSummary"];
type LandmarkDifference = components["schemas"]["LandmarkDifference"];

/** One line; "nothing" if nothing differs. */
export function summaryText(summary: Summary): string {
  const parts: [number, string, string][] = [
    [summary.landmarks_added, "landmark", "added"],
    [summary.landmarks_changed, "landmark", "changed"],
    [summary.landmarks_removed, "landmark", "removed"],
    [summary.models_changed, "model", "changed"],
    [summary.views_added, "photograph", "added"],
    [summary.views_removed, "photograph", "removed"],
  ];
  const words = parts.filter(([number]) => number > 0).map(([number, one, what]) => `${count(number, one)} ${what}`);
  if (summary.walls_changed) words.push("walls changed");
  if (summary.underlay_changed) words.push("floor plan changed");
  if (summary.settings.length) words.push(`settings: ${summary.settings.join(", ")}`);
  return words.join(", ") || "nothing";
}

/** What differs of one landmark. */
export function landmarkText(difference: LandmarkDifference): string {
  const words: string[] = [];
  if (difference.old_name) words.push(`was ${difference.old_name}`);
  if (difference.fields.length) words.push(difference.fields.join(", "));
  if (difference.model_changed) words.push("learnt anew");
  if (difference.views_added) words.push(`${count(difference.views_added, "photograph")} more`);
  if (difference.views_removed) words.push(`${count(difference.views_removed, "photograph")} less`);
  return words.join("; ");
}

type Spot = [number, number];

/** Where landmarks were and are, as far as both are known and differ. */
export function movesOf(items: readonly LandmarkDifference[]): [Spot, Spot][] {
  return items.flatMap(({ before, after }): [Spot, Spot][] => {
    const [from, to] = [before?.place, after?.place];
    if (!from || !to || (from.x_m === to.x_m && from.y_m === to.y_m)) return [];
    return [[[from.x_m, from.y_m], [to.x_m, to.y_m]]];
  });
}

/** Where landmarks are that go. */
export function removedOf(items: readonly LandmarkDifference[]): Spot[] {
  return items.flatMap(({ change, before }): Spot[] => (change === "removed" && before?.place ? [[before.place.x_m, before.place.y_m]] : []));
}

/** By how much a landmark was moved; empty if it was not. */
export function movedText(difference: LandmarkDifference): string {
  const [move] = movesOf([difference]);
  return move ? `; moved by ${Math.hypot(move[1][0] - move[0][0], move[1][1] - move[0][1]).toFixed(2)} m` : "";
}
