// From where landmarks are seen: the areas of all of them, one upon the other, so that the colour is the stronger the more
// landmarks a robot may see there. What stays bare is blind.
import Feature from "ol/Feature";
import MultiPolygon from "ol/geom/MultiPolygon";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Fill, Style } from "ol/style";

/** The area of one landmark: polygons, each with its holes, in metres. */
export type SeenArea = number[][][][];

/** Opacity of one area. */
const ONE = "30";

export function seenLayer(areas: readonly SeenArea[], colour: string): VectorLayer {
  const features = areas.map((area) => new Feature(new MultiPolygon(area)));
  const style = new Style({ fill: new Fill({ color: `${colour}${ONE}` }) });
  return new VectorLayer({ source: new VectorSource({ features }), style, zIndex: 1 }) as unknown as VectorLayer;
}
