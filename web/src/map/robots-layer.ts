// Robots: heading, trail, 95 % ellipse of the position, cone of the heading. A pose that is too old is grey.
import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import Point from "ol/geom/Point";
import Polygon from "ol/geom/Polygon";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import { Fill, RegularShape, Stroke, Style, Text } from "ol/style";
import { ago } from "../words/amounts";
import { isStale } from "../words/robots";
import type { Colours } from "./colours";
import { type Point as Position, ellipse, ring, yawHalf } from "./geometry";
import type { Hypothesis, LiveRobot } from "./live.svelte";

/** Length of the cone of the heading, m. */
export const CONE_M = 1.2;

export interface RobotLayer {
  layer: VectorLayer;
  show(robots: Iterable<LiveRobot>, now_ms: number): void;
}

export function robotLayer(colours: Colours): RobotLayer {
  const source = new VectorSource();
  // Names of landmarks make room for robots.
  const layer = new VectorLayer({ source, updateWhileInteracting: true, declutter: "landmarks" });
  return {
    layer,
    show(robots, now_ms) {
      const features: Feature[] = [];
      for (const robot of robots) features.push(...drawn(robot, now_ms, colours));
      source.clear(true);
      source.addFeatures(features);
    },
  };
}

/** The features of one robot: possible places, trail, ellipse, cone, the robot itself. */
export function drawn(robot: LiveRobot, now_ms: number, colours: Colours): Feature[] {
  const { pose, covariance, trail, name } = robot;
  const places = robot.hypotheses.map((place) => possible(place, name, colours));
  if (!pose) return places;
  const stale = isStale(robot, now_ms);
  const colour = stale ? colours.stale : colours.robot;
  const at: Position = [pose.x_m, pose.y_m];
  const path = feature(new LineString(trail), new Style({ stroke: new Stroke({ color: `${colour}99`, width: 2 }) }));
  const features = trail.length > 1 ? [...places, path] : places;
  if (covariance.length === 9) {
    const edge = new Style({ stroke: new Stroke({ color: colour, width: 1.5 }), fill: new Fill({ color: `${colour}26` }) });
    features.push(feature(new Polygon([ring(at, ellipse(covariance))]), edge));
    features.push(feature(new Polygon([cone(at, pose.theta_rad, yawHalf(covariance))]), new Style({ fill: new Fill({ color: `${colour}33` }) })));
  }
  const image = new RegularShape({
    points: 3,
    radius: 9,
    rotation: Math.PI / 2 - pose.theta_rad,
    rotateWithView: true,
    declutterMode: "obstacle",
    fill: new Fill({ color: colour }),
    stroke: new Stroke({ color: colours.halo, width: 1.5 }),
  });
  const label = stale ? `${name} (${ago(now_ms - robot.posed_ms)})` : name;
  const text = new Text({
    text: label,
    declutterMode: "obstacle",
    font: "600 12px Inter, system-ui, sans-serif",
    offsetY: -16,
    fill: new Fill({ color: colours.text }),
    stroke: new Stroke({ color: colours.halo, width: 3 }),
  });
  const robotItself = feature(new Point(at), new Style({ image, text, zIndex: 5 }));
  robotItself.set("robot", name);
  features.push(robotItself);
  return features;
}

/** A place where a robot may be: the stronger, the more probable. */
function possible({ probability, pose, covariance }: Hypothesis, name: string, colours: Colours): Feature {
  const at: Position = [pose.x_m, pose.y_m];
  const strength = Math.round(40 + 150 * Math.min(1, probability)).toString(16).padStart(2, "0");
  const text = new Text({
    text: `${name}? ${Math.round(100 * probability)} %`,
    declutterMode: "obstacle",
    font: "12px Inter, system-ui, sans-serif",
    fill: new Fill({ color: colours.text }),
    stroke: new Stroke({ color: colours.halo, width: 3 }),
  });
  const style = new Style({ stroke: new Stroke({ color: colours.stale, width: 1.5, lineDash: [4, 3] }), fill: new Fill({ color: `${colours.stale}${strength}` }), text });
  return feature(new Polygon([ring(at, ellipse(covariance))]), style);
}

function feature(geometry: LineString | Polygon | Point, style: Style): Feature {
  const made = new Feature<LineString | Polygon | Point>(geometry);
  made.setStyle(style);
  return made;
}

function cone(at: Position, theta: number, half: number): Position[] {
  const edge = Array.from({ length: 13 }, (_, i): Position => {
    const angle = theta - half + (2 * half * i) / 12;
    return [at[0] + CONE_M * Math.cos(angle), at[1] + CONE_M * Math.sin(angle)];
  });
  return [at, ...edge, at];
}
