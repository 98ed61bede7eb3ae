// A landmark that is being placed: its width, and an arrow where it looks, with a round handle at its end.
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import Point from "ol/geom/Point";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Circle, Fill, Stroke, Style } from "ol/style";
import { colours } from "./colours";
import type { Point as Position } from "./geometry";

/** `handle` is the end of the arrow; `undefined` while its direction is not known. `width_m` is that of the landmark. */
export function placingLayer(at: Position, handle: Position | undefined, width_m: number): VectorLayer {
  const { accent, halo } = colours();
  const made = (geometry: LineString | Point, style: Style) => {
    const feature = new Feature<LineString | Point>(geometry);
    feature.setStyle(style);
    return feature;
  };
  const dot = (radius: number, fill: string, edge: string) => new Style({ image: new Circle({ radius, fill: new Fill({ color: fill }), stroke: new Stroke({ color: edge, width: 3 }) }), zIndex: 2 });
  const features = [made(new Point(at), dot(6, accent, halo))];
  if (handle) {
    const theta = Math.atan2(handle[1] - at[1], handle[0] - at[0]);
    const [dx, dy] = [(-Math.sin(theta) * width_m) / 2, (Math.cos(theta) * width_m) / 2];
    const line = (width: number) => new Style({ stroke: new Stroke({ color: accent, width }) });
    features.push(made(new LineString([[at[0] - dx, at[1] - dy], [at[0] + dx, at[1] + dy]]), line(7)), made(new LineString([at, handle]), line(2)));
    features.push(made(new Point(handle), dot(10, halo, accent)));
  }
  return new VectorLayer({ source: new VectorSource({ features }), zIndex: 10 }) as unknown as VectorLayer;
}
