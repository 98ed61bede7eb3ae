// The form of a map.
import type { MapBody } from "../../api/types";

export interface MapFields {
  name: string;
  site: string;
  building: string;
  floor: string;
}

export const emptyForm = (): MapFields => ({ name: "", site: "", building: "", floor: "" });

export const formOf = (map: MapBody): MapFields => ({
  name: map.name,
  site: map.site ?? "",
  building: map.building ?? "",
  floor: map.floor ?? "",
});

/** The body of a request; what is empty is absent. */
export function patchOf({ name, site, building, floor }: MapFields) {
  const text = (value: string) => value.trim() || null;
  return { name: name.trim(), site: text(site), building: text(building), floor: text(floor) };
}
