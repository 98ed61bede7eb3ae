// Something that is read from the server: on its way, here, or refused with a reason. It is read again when the server is
// back after it was away.
import { onDestroy } from "svelte";
import { ApiError } from "../api/client";
import { clock, whenBack } from "../api/connection.svelte";

export class Loaded<T> {
  value = $state.raw<T>();
  trouble = $state("");
  /** HTTP status of the refusal; 0 if no answer came. */
  status = $state<number>();
  /** When the value was read, ms since the Unix epoch. */
  read_ms = $state(0);
  #read: () => Promise<T>;
  #turn = 0;

  /** `is_form`: it fills a form, so that it is not read anew by itself: what was typed would be lost. */
  constructor(read: () => Promise<T>, { is_form = false } = {}) {
    this.#read = read;
    const leave = whenBack(() => {
      if (!is_form || this.value === undefined) void this.again();
    });
    onDestroy(leave);
    void this.again();
  }

  /** How long ago it was read, ms; it grows by itself. */
  get age_ms(): number {
    return Math.max(0, clock.now_ms - this.read_ms);
  }

  /** Reads it again; what is shown stays until the answer is here. */
  again = async (): Promise<void> => {
    const turn = ++this.#turn;
    try {
      const value = await this.#read();
      // An answer that was overtaken by a newer question is not shown.
      if (turn !== this.#turn) return;
      [this.value, this.read_ms] = [value, Date.now()];
      [this.trouble, this.status] = ["", undefined];
    } catch (error) {
      if (turn !== this.#turn) return;
      this.trouble = error instanceof Error ? error.message : String(error);
      this.status = error instanceof ApiError ? error.status : undefined;
    }
  };
}
