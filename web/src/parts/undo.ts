// The way back from a change of a map: the commit that it has made is undone. What is later stays.
import { change, get, getRevised, path } from "../api/client";
import { may } from "../api/session.svelte";

export type Undo = (() => Promise<void>) | undefined;

const newest = async (map: string): Promise<number> => (await get(path("/maps/{map}/commits", { map }), { limit: 1 })).items[0]?.id ?? 0;

/** Changes a map. Returns the way back; `undefined` where one may not undo it, or nothing was changed. `then` reads anew. */
export async function undoable(map: string, work: () => Promise<unknown>, then: () => unknown): Promise<Undo> {
  const asked = may("POST /maps/{map}/commits/{commit}/undo") ? await newest(map).catch(() => undefined) : undefined;
  await work();
  if (asked === undefined) return undefined;
  const commit = await newest(map).catch(() => asked);
  if (commit <= asked) return undefined;
  return async () => {
    const { revision } = await getRevised(path("/maps/{map}", { map }));
    await change("POST", path("/maps/{map}/commits/{commit}/undo", { map, commit }), { ifMatch: revision });
    await then();
  };
}
