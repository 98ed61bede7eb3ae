// How a robot stands on its map, and how long ago anything was heard of it.
import { ago } from "./amounts";

/** A pose that is older is no pose, ms. */
export const STALE_MS = 2000;

/** What is known of a robot; times by the page's clock, ms. */
export interface Heard {
  is_connected: boolean;
  pose?: object | undefined;
  posed_ms: number;
  heard_ms?: number | undefined;
}

/** Whether its pose is too old to rely on. */
export const isStale = (robot: Heard, now_ms: number) => !robot.is_connected || now_ms - robot.posed_ms > STALE_MS;

export function robotState(robot: Heard, now_ms: number): { word: string; kind: "good" | "warn" | "bad" } {
  if (!robot.is_connected) return { word: "Not connected", kind: "bad" };
  if (!robot.pose) return { word: "No position", kind: "warn" };
  return isStale(robot, now_ms) ? { word: "No fresh position", kind: "warn" } : { word: "Live", kind: "good" };
}

/** The age of its pose, or, where it has none, of its last message. */
export function robotAge({ pose, posed_ms, heard_ms }: Heard, now_ms: number): string {
  if (pose) return `position ${ago(now_ms - posed_ms)}`;
  return heard_ms === undefined ? "not heard since the server's start" : `last seen ${ago(now_ms - heard_ms)}`;
}
