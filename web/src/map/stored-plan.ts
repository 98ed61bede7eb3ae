// The floor plan of a map, with its picture, from the server.
import { get, path } from "../api/client";
import type { MapBody } from "../api/types";
import type { Plan } from "./underlay-layer";

export async function storedPlan({ name, has_underlay }: MapBody): Promise<Plan | undefined> {
  if (!has_underlay) return undefined;
  const underlay = await get(path("/maps/{map}/underlay", { map: name }));
  const picture = await fetch(`/api/v1${path`/maps/${name}/underlay/image`}`);
  return { underlay, picture: await createImageBitmap(await picture.blob()) };
}
