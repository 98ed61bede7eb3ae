// What changes on the server, as it tells: pages read again instead of asking every few seconds.
import { onDestroy } from "svelte";
import { address } from "../api/client";
import { Stream } from "../api/stream";

type Kind = "map_changed" | "landmark_changed" | "landmarks_changed" | "job" | "presence" | "gathering" | "backup";

/** Events that come within this time count as one, ms. */
const TOGETHER_MS = 250;

/** Calls `then` after events of these kinds, of one map or all, and where some were missed. Ends with the component that asks. */
export function whenChanged(kinds: readonly Kind[], then: () => void, map?: string): void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const tell = () => (timer ??= setTimeout(() => {
    timer = undefined;
    then();
  }, TOGETHER_MS));
  const on = Object.fromEntries([...kinds, "reset"].map((kind) => [kind, tell]));
  // What changed between the reading and the opening of the stream is not told: it is read again.
  const stream = new Stream(address("/events", { map }), { on, onopen: tell });
  onDestroy(() => {
    stream.close();
    clearTimeout(timer);
  });
}
