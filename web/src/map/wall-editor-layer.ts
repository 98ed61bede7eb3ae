// What the editor of walls adds to the walls: the chosen one with its ends, the wall that would be drawn, walls that are
// offered.
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiLineString from "ol/geom/MultiLineString";
import MultiPoint from "ol/geom/MultiPoint";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Circle, Fill, Stroke, Style } from "ol/style";
import { colours } from "./colours";
import type { Point } from "./geometry";
import type { Wall } from "./wall-editor.svelte";

type Shape = LineString | MultiLineString | MultiPoint;

export function wallEditorLayer(chosen: Wall | undefined, line: readonly Point[], offered: readonly Wall[]): VectorLayer {
  const { accent, halo, state } = colours();
  const made = (geometry: Shape, style: Style) => {
    const feature = new Feature<Shape>(geometry);
    feature.setStyle(style);
    return feature;
  };
  const dots = new Style({ image: new Circle({ radius: 6, fill: new Fill({ color: halo }), stroke: new Stroke({ color: accent, width: 3 }) }) });
  const features: Feature<Shape>[] = [];
  const dashed = new Style({ stroke: new Stroke({ color: state.flagged, width: 4, lineDash: [8, 5] }) });
  if (offered.length) features.push(made(new MultiLineString(offered.map(({ a, b }) => [a, b])), dashed));
  if (chosen) {
    const thick = new Style({ stroke: new Stroke({ color: accent, width: 6 }) });
    features.push(made(new LineString([chosen.a, chosen.b]), thick), made(new MultiPoint([chosen.a, chosen.b]), dots));
  }
  if (line.length) features.push(made(new MultiPoint([...line]), dots));
  if (line.length > 1) features.push(made(new LineString([...line]), new Style({ stroke: new Stroke({ color: accent, width: 3, lineDash: [6, 4] }) })));
  return new VectorLayer({ source: new VectorSource({ features }), zIndex: 10 }) as unknown as VectorLayer;
}
