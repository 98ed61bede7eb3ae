// The way back from a change of a map: the commit that it has made is undone. What is later stays.
import { change, get, getRevised, path } from "../api/client";
import { may } from "../api/session.svelte";
import type { Commit, Listed, MapBody } from "../api/types";

export type Undo = (() => Promise<void>) | undefined;

const newest = async (map: string): Promise<number> => (await get<Listed<Commit>>(path`/maps/${map}/commits`, { limit: 1 })).items[0]?.id ?? 0;

/** Changes a map. Returns the way back; `undefined` where one may not undo it, or nothing was changed. `then` reads anew. */
export async function undoable(map: string, work: () => Promise<unknown>, then: () => unknown): Promise<Undo> {
  const asked = may("POST /maps/{map}/commits/{commit}/undo") ? await newest(map).catch(() => undefined) : undefined;
  await work();
  if (asked === undefined) return undefined;
  const commit = await newest(map).catch(() => asked);
  if (commit <= asked) return undefined;
  return async () => {
    const { revision } = await getRevised<MapBody>(path`/maps/${map}`);
    await change("POST", path`/maps/${map}/commits/${commit}/undo`, { ifMatch: revision });
    await then();
  };
}
