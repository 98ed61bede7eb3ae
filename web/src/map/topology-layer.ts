// Places and passages of a site's maps on one of them, and a route through them with the landmarks to look for.
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiLineString from "ol/geom/MultiLineString";
import MultiPoint from "ol/geom/MultiPoint";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Circle, Fill, Stroke, Style } from "ol/style";
import type { SiteTopology } from "../api/types";
import { colours } from "./colours";
import type { Point } from "./geometry";

/** What of a topology lies on one map, in metres. */
export interface OnMap {
  places: Point[];
  /** From the centre of each place to the middles of its passages. */
  ways: [Point, Point][];
  route: Point[][];
  /** From where the robot is to where its camera looks. */
  looks: [Point, Point][];
}

export function onMap({ places, passages, route }: SiteTopology, map: string): OnMap {
  const here = new Map(places.flatMap((one) => (one.map === map ? [[one.place, [one.x_m, one.y_m] as Point]] : [])));
  const legs = route?.legs.filter(({ place }) => here.has(place)) ?? [];
  return {
    places: [...here.values()],
    ways: passages.flatMap(({ ends }) =>
      ends.flatMap(({ place, x_m, y_m }): [Point, Point][] => {
        const centre = here.get(place);
        return centre ? [[centre, [x_m, y_m]]] : [];
      }),
    ),
    route: legs.map(({ path }) => path.map(([x = 0, y = 0]): Point => [x, y])),
    looks: legs.flatMap(({ next_landmark: look }): [Point, Point][] => {
      if (!look) return [];
      const bearing = look.theta_rad + look.pan_rad;
      return [[[look.x_m, look.y_m], [look.x_m + look.range_m * Math.cos(bearing), look.y_m + look.range_m * Math.sin(bearing)]]];
    }),
  };
}

export function topologyLayer({ places, ways, route, looks }: OnMap): VectorLayer {
  const { accent, halo, stale } = colours();
  const drawn = (geometry: MultiPoint | MultiLineString | LineString, style: Style) => {
    const made = new Feature(geometry);
    made.setStyle(style);
    return made;
  };
  const line = (color: string, width: number, lineDash: number[] = []) => new Style({ stroke: new Stroke({ color, width, lineDash }) });
  const dot = new Circle({ radius: 6, fill: new Fill({ color: stale }), stroke: new Stroke({ color: halo, width: 2 }) });
  const features = [
    drawn(new MultiLineString(ways), line(stale, 2)),
    drawn(new MultiPoint(places), new Style({ image: dot })),
    ...route.map((points) => drawn(new LineString(points), line(accent, 4))),
    drawn(new MultiLineString(looks), line(accent, 2, [4, 6])),
  ];
  return new VectorLayer({ source: new VectorSource({ features }), zIndex: 8 }) as unknown as VectorLayer;
}
