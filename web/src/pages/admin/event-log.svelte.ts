// The events of the server, the newest first, as many as fit in a table. After a break it goes on where it was.
import { address } from "../../api/client";
import { Stream } from "../../api/stream";
import type { ServerEvent } from "../../api/types";
import { EVENT_KINDS } from "../../words/events";

/** Events kept, the newest. The server remembers twice as many. */
export const MOST_EVENTS = 500;

/** The list with one more event in front. One that is there already, because a stream went on before it, is not doubled. */
export function withEvent(events: readonly ServerEvent[], event: ServerEvent, most = MOST_EVENTS): ServerEvent[] {
  if (events.some(({ id, kind }) => id === event.id && kind === event.kind)) return [...events];
  return [event, ...events].slice(0, most);
}

/** The id from which on the newest `most` events follow, of the id of the newest one; `undefined` where there are none. */
export function earlier(id: string, most = MOST_EVENTS): string | undefined {
  const [, start, number] = /^(\d+)-(\d+)$/.exec(id) ?? [];
  if (start === undefined || Number(number) === 0) return undefined;
  return `${start}-${Math.max(0, Number(number) - most)}`;
}

export class EventLog {
  events = $state.raw<ServerEvent[]>([]);
  link = $state<"connecting" | "live" | "lost">("connecting");
  #stream: Stream;
  #last: string | undefined;

  constructor() {
    this.#stream = this.#follow();
  }

  close(): void {
    this.#stream.close();
  }

  #follow(): Stream {
    const heard = (message: MessageEvent<string>) => {
      const event = JSON.parse(message.data) as ServerEvent;
      this.#last = event.id;
      this.events = withEvent(this.events, event);
    };
    const kinds = [...Object.keys(EVENT_KINDS), "landmarks_changed", "reset"];
    return new Stream(() => address("/events", { last_event_id: this.#last }), {
      on: { ...Object.fromEntries(kinds.map((kind) => [kind, heard])), ready: (message) => this.#begin(message.lastEventId) },
      onopen: () => (this.link = "live"),
      onlost: () => (this.link = "lost"),
    });
  }

  /** A new stream tells only what comes: one that begins earlier takes its place. */
  #begin(newest: string): void {
    const first = earlier(newest);
    this.#last ??= first ?? newest;
    if (first === undefined) return;
    this.#stream.close();
    this.#stream = this.#follow();
  }
}
