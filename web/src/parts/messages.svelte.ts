// What was done, with a way back where there is one, and what went wrong. Shown until it is closed or replaced.
export interface Message {
  id: number;
  text: string;
  is_error: boolean;
  undo?: (() => Promise<void>) | undefined;
}

/** Most messages at a time: the oldest go. */
const MOST = 4;
/** How long a message without a fault stays, ms: longer if it has a way back. */
const STAYS_MS = 12_000;
const UNDO_STAYS_MS = 60_000;
let count = 0;

export const messages = $state<Message[]>([]);

export function close(id: number): void {
  const at = messages.findIndex((message) => message.id === id);
  if (at >= 0) messages.splice(at, 1);
}

function show(message: Omit<Message, "id">): void {
  const id = ++count;
  messages.push({ ...message, id });
  if (messages.length > MOST) messages.shift();
  if (!message.is_error) setTimeout(() => close(id), message.undo ? UNDO_STAYS_MS : STAYS_MS);
}

/** Says what was done. */
export const done = (text: string, undo?: () => Promise<void>) => show({ text, is_error: false, undo });

/** Says what went wrong. */
export const failed = (error: unknown) => show({ text: error instanceof Error ? error.message : String(error), is_error: true });

/** Does something, and says what went wrong if it fails. Whether it was done. */
export async function attempt(work: () => Promise<void>): Promise<boolean> {
  try {
    await work();
    return true;
  } catch (error) {
    failed(error);
    return false;
  }
}
