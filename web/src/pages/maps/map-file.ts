// A whole map as a file, kept for as long as its deletion can be taken back.
import { address, change, newKey, path } from "../../api/client";
import { may } from "../../api/session.svelte";
import type { MapBody } from "../../api/types";

/** A larger map is not kept by the page: its file is to be saved first. */
const MOST_BYTES = 200e6;
/** A map of 1 GB on a slow link, ms. */
export const LOAD_MS = 1_800_000;

/** Loads a map from a file. */
export const loadMap = (content: Blob, query: { name?: string | undefined; without_link?: boolean | undefined } = {}) =>
  change("POST", "/bundles", { file: { content, kind: "application/zip", deadline_ms: LOAD_MS }, query, key: newKey() });

/** The file of a map; `undefined` if it is too large, or may not be loaded again. */
async function kept(map: string): Promise<Blob | undefined> {
  if (!may("POST /bundles") || !may("GET /maps/{map}/bundle")) return undefined;
  const answer = await fetch(address(path`/maps/${map}/bundle`));
  if (!answer.ok || !answer.body) return undefined;
  const parts: Uint8Array<ArrayBuffer>[] = [];
  let bytes = 0;
  const reader = answer.body.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return new Blob(parts, { type: "application/zip" });
    bytes += value.byteLength;
    if (bytes > MOST_BYTES) {
      await reader.cancel();
      return undefined;
    }
    parts.push(value);
  }
}

/** Deletes a map. Returns the way back, or `undefined` if the map could not be kept. */
export async function deleteMap(map: MapBody): Promise<(() => Promise<unknown>) | undefined> {
  const file = await kept(map.name).catch(() => undefined);
  await change("DELETE", path("/maps/{map}", { map: map.name }), { ifMatch: map.revision ?? "*" });
  return file && (() => loadMap(file));
}
