// Whether the server answers. Each request tells; while none is under way, the server is asked by itself. When it is back,
// everybody who waits for it is told: streams open again, pages read again.

/** A server that was not heard for so long is asked, ms. */
const ASK_AFTER_MS = 2500;
/** Time that it has for the answer, ms. */
const ANSWER_MS = 5000;
/** While it is away: time until the next question, ms; twice as long each time, up to the most. */
const AGAIN_MS = 500;
const AGAIN_MOST_MS = 4000;
const TICK_MS = 500;

export const connection = $state({
  /** When it was last heard before it was lost, ms since the Unix epoch; `undefined` while there is a connection. */
  lost_since: undefined as number | undefined,
});
/** The time, once a second: what is shown with its age grows older by itself. */
export const clock = $state({ now_ms: Date.now() });

let heard_ms = Date.now();
let asked_ms = 0;
let wait_ms = AGAIN_MS;
let question: () => Promise<unknown> = async () => {};
const waiting = new Set<() => void>();

/** The server has answered something. */
export function heard(): void {
  heard_ms = Date.now();
  if (connection.lost_since === undefined) return;
  connection.lost_since = undefined;
  wait_ms = AGAIN_MS;
  for (const then of [...waiting]) then();
}

/** A request got no answer. */
export function missed(): void {
  connection.lost_since ??= heard_ms;
}

/** Calls `then` whenever the server is back. Returns how to end that. */
export function whenBack(then: () => void): () => void {
  waiting.add(then);
  return () => waiting.delete(then);
}

/** Asks the server now, by what `watch` was given. */
export async function probe(): Promise<void> {
  asked_ms = Date.now();
  await question().catch(() => undefined);
}

/** Watches the connection from now on. `ask` is a request that ends within this time and tells `heard` or `missed`. */
export function watch(ask: (signal: AbortSignal) => Promise<unknown>): void {
  question = () => ask(AbortSignal.timeout(ANSWER_MS));
  addEventListener("online", () => void probe());
  addEventListener("offline", missed);
  setInterval(() => {
    const now = Date.now();
    if (now - clock.now_ms >= 1000 - TICK_MS / 2) clock.now_ms = now;
    if (document.visibilityState === "hidden") return;
    const is_lost = connection.lost_since !== undefined;
    if (now - (is_lost ? asked_ms : Math.max(heard_ms, asked_ms)) < (is_lost ? wait_ms : ASK_AFTER_MS)) return;
    if (is_lost) wait_ms = Math.min(2 * wait_ms, AGAIN_MOST_MS);
    void probe();
  }, TICK_MS);
}
