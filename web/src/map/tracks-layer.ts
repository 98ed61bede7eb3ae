// Where odometry alone takes each robot, and where a simulator says that it truly is.
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Stroke, Style } from "ol/style";
import type { Colours } from "./colours";
import type { Point } from "./geometry";
import type { LiveRobot } from "./live.svelte";

export interface TracksLayer {
  layer: VectorLayer;
  show(robots: Iterable<LiveRobot>): void;
}

export function tracksLayer(colours: Colours): TracksLayer {
  const source = new VectorSource();
  const layer = new VectorLayer({ source, updateWhileInteracting: true });
  const odometry = new Style({ stroke: new Stroke({ color: colours.stale, width: 2, lineDash: [6, 4] }) });
  const truth = new Style({ stroke: new Stroke({ color: colours.accent, width: 2 }) });
  const line = (points: Point[], style: Style) => {
    if (points.length < 2) return [];
    const made = new Feature(new LineString(points));
    made.setStyle(style);
    return [made];
  };
  return {
    layer,
    show(robots) {
      source.clear(true);
      for (const robot of robots) source.addFeatures([...line(robot.odometry, odometry), ...line(robot.truth, truth)]);
    },
  };
}
