import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import type { ServerEvent } from "../../src/api/types";
import { earlier, withEvent } from "../../src/pages/admin/event-log.svelte";
import { EVENT_KINDS, eventWords, kindOf } from "../../src/words/events";

const event = (number: number, fields: object = { kind: "tokens_changed" }) => ({ id: `17-${number}`, at_ms: 1000 * number, ...fields }) as ServerEvent;

test("events stand newest first, once each, and no more than fit", () => {
  let events: ServerEvent[] = [];
  for (let i = 1; i <= 9; i++) events = withEvent(events, event(i), 5);
  expect(events.map(({ id }) => id)).toEqual(["17-9", "17-8", "17-7", "17-6", "17-5"]);
  expect(withEvent(events, event(7), 5)).toEqual(events);
  // Where events are missing, the server gives the id of the newest one.
  expect(withEvent(events, event(9, { kind: "reset" }), 5)[0]?.kind).toBe("reset");
});

test("a stream begins before the newest event", () => {
  expect([earlier("17-9", 5), earlier("17-3", 5), earlier("17-0"), earlier("nothing")]).toEqual(["17-4", "17-0", undefined, undefined]);
});

test("every kind of event has words", () => {
  const source = readFileSync("../protos/src/api/events.rs", "utf8");
  const kinds = [...(/KINDS[^=]*=\s*\[([^\]]*)\]/.exec(source)?.[1] ?? "").matchAll(/"(\w+)"/g)].map((found) => found[1] ?? "");
  expect(kinds.length).toBeGreaterThan(7);
  const fields = { map: "hall", version: 3, landmark: "door", change: "added", count: 200, job: 7, state: "done", robot: "r1", present: true, gathering: 2, backup: "b" };
  for (const kind of kinds) {
    expect(eventWords(event(1, { ...fields, kind }))?.text, kind).toMatch(/ .*\.$/);
    expect(kind === "ready" || kind === "reset" || (kindOf(event(1, { kind })) ?? "") in EVENT_KINDS, kind).toBe(true);
  }
  expect(eventWords(event(1, { ...fields, kind: "presence", present: false })).text).toBe("The robot r1 is gone, on hall.");
  expect(eventWords(event(1, { ...fields, kind: "map_changed", version: null }))).toEqual({ text: "The map hall is deleted." });
});
