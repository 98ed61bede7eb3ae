// Points and a line that a tool has set on the floor.
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiPoint from "ol/geom/MultiPoint";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Circle, Fill, RegularShape, Stroke, Style } from "ol/style";
import { colours } from "./colours";
import type { Point } from "./geometry";

export function overlay(points: readonly Point[], is_line: boolean): VectorLayer {
  const { accent, halo } = colours();
  const features: Feature<LineString | MultiPoint>[] = [new Feature<LineString | MultiPoint>(new MultiPoint([...points]))];
  if (is_line && points.length > 1) features.push(new Feature<LineString | MultiPoint>(new LineString([...points])));
  const style = new Style({
    stroke: new Stroke({ color: accent, width: 2.5 }),
    image: new Circle({ radius: 5, fill: new Fill({ color: accent }), stroke: new Stroke({ color: halo, width: 2 }) }),
  });
  const source = new VectorSource<Feature<LineString | MultiPoint>>({ features });
  return new VectorLayer({ source, style, zIndex: 9 }) as unknown as VectorLayer;
}

/** Lines from where something was to where it is. */
export function moves(all: readonly [Point, Point][]): VectorLayer {
  const { accent } = colours();
  const source = new VectorSource({ features: all.map((ends) => new Feature(new LineString(ends))) });
  const style = new Style({ stroke: new Stroke({ color: accent, width: 2, lineDash: [6, 4] }) });
  return new VectorLayer({ source, style, zIndex: 8 }) as unknown as VectorLayer;
}

/** Crosses where something goes. */
export function gone(all: readonly Point[]): VectorLayer {
  const { state, halo } = colours();
  const source = new VectorSource({ features: all.map((at) => new Feature(new MultiPoint([at]))) });
  const cross = (colour: string, width: number) => new Style({ image: new RegularShape({ points: 4, radius: 10, radius2: 0, angle: Math.PI / 4, stroke: new Stroke({ color: colour, width }) }) });
  return new VectorLayer({ source, style: [cross(halo, 6), cross(state.quarantined, 3)], zIndex: 8 }) as unknown as VectorLayer;
}

/** Points of a path by how many landmarks are seen from them: none, one, more. */
export function covered(steps: readonly { x_m: number; y_m: number; landmarks: unknown[] }[]): VectorLayer {
  const { state } = colours();
  const features = steps.map(({ x_m, y_m, landmarks }) => {
    const colour = landmarks.length === 0 ? state.quarantined : landmarks.length === 1 ? state.inactive : state.active;
    const made = new Feature(new MultiPoint([[x_m, y_m]]));
    made.setStyle(new Style({ image: new Circle({ radius: 5, fill: new Fill({ color: colour }) }), zIndex: 3 }));
    return made;
  });
  return new VectorLayer({ source: new VectorSource({ features }), zIndex: 8 }) as unknown as VectorLayer;
}
