// The walls: many segments in few features, drawn as a picture, so that 20 000 of them are moved fast.
import Feature from "ol/Feature";
import MultiLineString from "ol/geom/MultiLineString";
import VectorImageLayer from "ol/layer/VectorImage";
import VectorSource from "ol/source/Vector";
import { Stroke, Style } from "ol/style";
import type { Walls } from "../api/types";
import type { Colours } from "./colours";

/** Segments of one feature: neighbours in the list are mostly neighbours on the floor. */
const TOGETHER = 500;

export function wallsLayer(walls: Walls, colours: Colours): VectorImageLayer {
  const source = new VectorSource();
  for (let i = 0; i < walls.segments.length; i += TOGETHER) {
    const lines = walls.segments.slice(i, i + TOGETHER).map(({ a, b }) => [a, b]);
    source.addFeature(new Feature(new MultiLineString(lines)));
  }
  const style = new Style({ stroke: new Stroke({ color: colours.wall, width: 2 }) });
  // Drawn once, somewhat beyond what is seen; the picture is moved while the map is.
  return new VectorImageLayer({ source, style, imageRatio: 1.5 });
}
