// How far the position by a picture was from the known one, in words.
import type { PriorCheck } from "../api/types";

/** A squared Mahalanobis distance, for people: as many standard deviations. */
const sigmas = (distance2: number) => `${Math.sqrt(distance2).toFixed(1)} sigma`;

export function priorText({ source, distance2, limit, refused }: PriorCheck): string {
  const whose = source === "robot" ? "the one that the robot sent" : "the one that the server had";
  if (distance2 === null || distance2 === undefined) return `The picture gave no position to compare with ${whose}.`;
  const lies = `the position by the picture and ${whose} are ${sigmas(distance2)} apart`;
  const most = `at most ${sigmas(limit)}`;
  if (refused) return `Disagrees: ${lies}; ${most} is let pass.`;
  if (source === "robot") return `Agrees: ${lies}; ${most} is let pass.`;
  return `${lies.charAt(0).toUpperCase()}${lies.slice(1)}. The server's own position refuses nothing, so that a picture can correct it: it only chooses between two solutions, within ${most.slice(8)}.`;
}
