// The layers of a map and their order. A list begins with the lowest layer; the address holds an order that is not the usual one.

export interface LayerEntry {
  name: string;
  title: string;
  is_on: boolean;
  opacity: number;
}

/** The layers in their usual order. */
export const LAYERS: readonly { name: string; title: string; opacity: number }[] = [
  { name: "plan", title: "Floor plan", opacity: 0.6 },
  { name: "walls", title: "Walls", opacity: 1 },
  { name: "landmarks", title: "Landmarks", opacity: 1 },
  { name: "tracks", title: "Odometry (dashed), truth of a simulator", opacity: 1 },
  { name: "robots", title: "Robots", opacity: 1 },
];
/** The layers that are off in a new view, as the address has it. */
const OFF = "tracks";

const USUAL = LAYERS.map(({ name }) => name).join(".");

/** The layers as an address has them. Names that it lacks keep their usual place, above the one that is usually below. */
export function layersOf(query: URLSearchParams): LayerEntry[] {
  const off = new Set((query.get("off") ?? OFF).split("."));
  const asked = (query.get("order") ?? "").split(".");
  const names = [...new Set(asked)].filter((name) => LAYERS.some((layer) => layer.name === name));
  LAYERS.forEach(({ name }, i) => {
    if (!names.includes(name)) names.splice(i === 0 ? 0 : names.indexOf(LAYERS[i - 1]?.name ?? "") + 1, 0, name);
  });
  return names.flatMap((name) => LAYERS.filter((layer) => layer.name === name).map((layer) => ({ ...layer, is_on: !off.has(name) })));
}

/** What the address keeps of them; `undefined` for what is usual. */
export function queryOf(layers: readonly LayerEntry[]): { off: string | undefined; order: string | undefined } {
  const off = layers.filter((layer) => !layer.is_on).map((layer) => layer.name).join(".");
  const order = layers.map((layer) => layer.name).join(".");
  return { off: off === OFF ? undefined : off || "none", order: order === USUAL ? undefined : order };
}

/** The list with one layer further up (1) or down (-1); the same list if it is at the end. */
export function moved<T extends { name: string }>(layers: readonly T[], name: string, by: 1 | -1): T[] {
  const list = [...layers];
  const from = list.findIndex((layer) => layer.name === name);
  const to = from + by;
  const [a, b] = [list[from], list[to]];
  if (a && b) [list[from], list[to]] = [b, a];
  return list;
}
