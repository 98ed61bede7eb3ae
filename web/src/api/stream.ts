// An event stream of the server while its page is looked at. A browser has six connections to one server over HTTP/1.1, and
// a stream holds one: pages in the background give theirs back, so that many open pages do not keep each other waiting.
//
// A browser gives a stream up for ever that is refused (401, 404, 502 of a proxy, 503), so each end is handled here: who is
// signed in is asked, and the stream is opened again, later each time, and at once when the server is back.
import { heard, probe, whenBack } from "./connection.svelte";

/** Time until a stream is opened again, ms; twice as long each time, up to the most. */
const AGAIN_MS = 500;
const AGAIN_MOST_MS = 8000;

export interface StreamEvents {
  on: Record<string, (event: MessageEvent<string>) => void>;
  /** The stream is open: events before this moment were missed. `again` but for the first time. */
  onopen?: (again: boolean) => void;
  /** The stream has ended; it is opened again. */
  onlost?: () => void;
}

export class Stream {
  #source: EventSource | undefined;
  #opened = false;
  #wait_ms = AGAIN_MS;
  #timer: ReturnType<typeof setTimeout> | undefined;
  readonly #address: () => string;
  readonly #events: StreamEvents;
  readonly #leave: () => void;

  /** An address that is a function is asked for whenever the stream is opened anew. */
  constructor(address: string | (() => string), events: StreamEvents) {
    this.#address = typeof address === "string" ? () => address : address;
    this.#events = events;
    document.addEventListener("visibilitychange", this.#look);
    this.#leave = whenBack(() => {
      this.#drop();
      this.#look();
    });
    this.#look();
  }

  close(): void {
    document.removeEventListener("visibilitychange", this.#look);
    this.#leave();
    this.#drop();
  }

  #drop(): void {
    clearTimeout(this.#timer);
    this.#source?.close();
    this.#source = undefined;
  }

  #look = (): void => {
    if (document.visibilityState === "hidden") this.#drop();
    else if (!this.#source) this.#open();
  };

  #open(): void {
    clearTimeout(this.#timer);
    const source = new EventSource(this.#address());
    this.#source = source;
    source.onopen = () => {
      this.#wait_ms = AGAIN_MS;
      heard();
      this.#events.onopen?.(this.#opened);
      this.#opened = true;
    };
    source.onerror = () => this.#lost();
    for (const [kind, then] of Object.entries(this.#events.on)) {
      source.addEventListener(kind, (event: MessageEvent<string>) => {
        heard();
        then(event);
      });
    }
  }

  #lost(): void {
    this.#drop();
    this.#events.onlost?.();
    this.#timer = setTimeout(this.#look, this.#wait_ms);
    this.#wait_ms = Math.min(2 * this.#wait_ms, AGAIN_MOST_MS);
    // The stream does not say why it has ended. A session that has ended leads to the page to sign in.
    void probe();
  }
}
