import { expect, test } from "vitest";
import type { Problem, Readiness, Servers } from "../../src/api/types";
import { diskText, faultsOf, healthState } from "../../src/words/health";

const storage = { total_bytes: 100e9, free_bytes: 60e9, reusable_bytes: 0, used_percent: 40, limit_percent: 90 };
const ready: Readiness = { status: "ready", counts: { maps_not_in_use: 0, damaged_pictures: 0 }, maps_not_in_use: {}, damaged_pictures: [], backup: { every_hours: 0 }, storage, panics: { job: 0 } };
const degraded = (fields: Partial<Readiness>): Readiness => ({ ...ready, status: "degraded", ...fields });
const problem = (code: string, detail: string): Problem => ({ type: `/problems/${code}`, title: "Service Unavailable", status: 503, code, detail });
const one = (fields: Partial<Readiness>) => {
  const faults = faultsOf(degraded(fields));
  expect(faults).toHaveLength(1);
  return faults[0];
};

test("a server without a fault is ready, and says when learning would be refused", () => {
  expect(faultsOf(ready)).toEqual([]);
  expect(healthState(ready).word).toBe("Ready");
  expect(diskText(storage)).toBe("40 % of 100.00 GB used, 60.00 GB free. From 90 % on, learning and uploads are refused; robots are served all the same.");
});

test("a disk without room is one fault with one advice", () => {
  const refused = "the disk of the data directory is 93 % full (limit 90 %), 7000 MB of 100000 MB are free: nothing is added until there is room. Delete backups, maps or gatherings that nobody needs, or enlarge the disk; then it goes on by itself";
  const fault = one({ storage: { ...storage, used_percent: 93, refused } });
  expect(fault?.sentence).toBe("The disk of the data directory is 93 % full (limit 90 %), 7000 MB of 100000 MB are free: nothing is added until there is room.");
  expect(fault?.advice).toBe("Delete backups, maps or gatherings that nobody needs, or enlarge the disk; then it goes on by itself.");
  expect(diskText({ ...storage, used_percent: 93, refused })).toMatch(/Learning and uploads are refused\.$/);
  expect(one({ storage: { ...storage, refused: "the disk is read-only" } })?.advice).toMatch(/^Delete backups/);
});

test("every fault is a sentence with an advice", () => {
  const servers = { contested_robots: { r1: ["a", "b"] } } as unknown as Servers;
  const faults = faultsOf(
    degraded({
      router: "no connection to tcp/10.0.0.1:7447; it is tried again",
      maps_not_served: { hall: "also on annex-server: delete or rename it on one of the servers" },
      maps_not_in_use: { yard: "out of memory" },
      counts: { maps_not_in_use: 1, damaged_pictures: 2 },
      damaged_pictures: ["view 3", "view 4"],
      backup: { every_hours: 24, failed: "no space left" },
      database_check: { state: "failed", ended_ms: 7, faults: ["row 3 missing from index landmarks_by_name"], advice: "stop the server, and restore a backup: waymark restore FILE --data DIR" },
      panics: { job: 0, request: 2 },
    }),
    servers,
  );
  expect(faults).toHaveLength(8);
  for (const { sentence, advice } of faults) for (const text of [sentence, advice]) expect(text).toMatch(/^[A-Z\d].* .*\.$/);
  expect(faults[1]).toEqual({ sentence: "Robots are refused on the map hall.", advice: "It is also on annex-server: delete or rename it on one of the servers.", is_grave: true });
  expect(faults[5]?.sentence).toBe("The database is damaged: row 3 missing from index landmarks_by_name.");
  const graves = faults.map(({ is_grave }) => is_grave);
  expect(graves).toEqual([...graves].sort((a, b) => Number(b) - Number(a)));
});

test("a server that is not ready says which part, and what to do", () => {
  for (const code of ["part_ended", "part_stalled", "storage_failed", "busy", "something_new"]) {
    const health = problem(code, "the writer of the store has not gone on for 7 s; after 30 s the server ends with an error");
    expect(healthState(health)).toMatchObject({ word: "Not ready", kind: "bad" });
    const [fault, ...more] = faultsOf(health);
    expect(more).toEqual([]);
    expect(fault?.sentence).toBe("The writer of the store has not gone on for 7 s; after 30 s the server ends with an error.");
    expect(fault?.advice).toMatch(/^[A-Z].*\.$/);
  }
});
