// Which modality was best where, as runs have shown. A square metre has four triangles, one for each heading in which it
// was driven through: the triangle lies on the side that the robot drives towards.
import Feature from "ol/Feature";
import Polygon from "ol/geom/Polygon";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Fill, Stroke, Style, Text } from "ol/style";
import type { ModalityMap } from "../api/types";
import type { Colours } from "./colours";

/** Colours by modality; a cell without one is not known well enough. */
export const MODALITIES: Record<string, { word: string; colour: string }> = {
  landmarks: { word: "landmarks", colour: "#2563eb" },
  laser: { word: "laser", colour: "#c2410c" },
  odometry: { word: "odometry", colour: "#7c3aed" },
};
const UNKNOWN = "#8b95a533";

export function modalityLayer({ cells, areas, cell_m }: ModalityMap, colours: Colours): VectorLayer {
  const half = cell_m / 2;
  const features = cells.map((cell) => {
    const [x, y] = [cell.x_m + half, cell.y_m + half];
    const [dx, dy] = [Math.cos(cell.heading_rad) * half, Math.sin(cell.heading_rad) * half];
    const made = new Feature(new Polygon([[[x, y], [x + dx - dy, y + dy + dx], [x + dx + dy, y + dy - dx], [x, y]]]));
    const known = cell.best ? MODALITIES[cell.best] : undefined;
    made.setStyle(new Style({ fill: new Fill({ color: known ? `${known.colour}99` : UNKNOWN }) }));
    return made;
  });
  for (const area of areas) {
    const made = new Feature(new Polygon([area.corners_m]));
    const text = new Text({ text: area.name, font: "12px system-ui, sans-serif", fill: new Fill({ color: colours.text }), stroke: new Stroke({ color: colours.halo, width: 3 }) });
    made.setStyle(new Style({ stroke: new Stroke({ color: colours.accent, width: 2 }), text }));
    features.push(made);
  }
  return new VectorLayer({ source: new VectorSource({ features }), zIndex: 1 }) as unknown as VectorLayer;
}
