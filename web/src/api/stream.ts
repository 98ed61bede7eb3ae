// An event stream of the server while its page is looked at. A browser has six connections to one server over HTTP/1.1, and
// a stream holds one: pages in the background give theirs back, so that many open pages do not keep each other waiting.

export interface StreamEvents {
  on: Record<string, (event: MessageEvent<string>) => void>;
  /** The stream is open: events before this moment were missed. `again` but for the first time. */
  onopen?: (again: boolean) => void;
  /** The server cannot be reached; the browser tries again by itself. */
  onlost?: () => void;
}

export class Stream {
  #source: EventSource | undefined;
  #opened = false;
  readonly #address: () => string;
  readonly #events: StreamEvents;

  /** An address that is a function is asked for whenever the stream is opened anew. */
  constructor(address: string | (() => string), events: StreamEvents) {
    this.#address = typeof address === "string" ? () => address : address;
    this.#events = events;
    document.addEventListener("visibilitychange", this.#look);
    this.#look();
  }

  close(): void {
    document.removeEventListener("visibilitychange", this.#look);
    this.#source?.close();
    this.#source = undefined;
  }

  #look = (): void => {
    if (document.visibilityState === "hidden") {
      this.#source?.close();
      this.#source = undefined;
    } else if (!this.#source) {
      this.#open();
    }
  };

  #open(): void {
    const source = new EventSource(this.#address());
    this.#source = source;
    source.onopen = () => {
      this.#events.onopen?.(this.#opened);
      this.#opened = true;
    };
    source.onerror = () => this.#events.onlost?.();
    for (const [kind, heard] of Object.entries(this.#events.on)) source.addEventListener(kind, heard);
  }
}
