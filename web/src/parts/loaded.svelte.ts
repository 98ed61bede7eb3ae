// Something that is read from the server: on its way, here, or refused with a reason.
export class Loaded<T> {
  value = $state.raw<T>();
  trouble = $state("");
  #read: () => Promise<T>;
  #turn = 0;

  constructor(read: () => Promise<T>) {
    this.#read = read;
    void this.again();
  }

  /** Reads it again; what is shown stays until the answer is here. */
  again = async (): Promise<void> => {
    const turn = ++this.#turn;
    try {
      const value = await this.#read();
      // An answer that was overtaken by a newer question is not shown.
      if (turn !== this.#turn) return;
      this.value = value;
      this.trouble = "";
    } catch (error) {
      if (turn === this.#turn) this.trouble = error instanceof Error ? error.message : String(error);
    }
  };
}
