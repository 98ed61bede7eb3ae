// Landmarks: a line along the width, in the colour of the state, with a label where there is room. Where many lie close, a
// circle with their number stands for them.
import Feature, { type FeatureLike } from "ol/Feature";
import LineString from "ol/geom/LineString";
import Point from "ol/geom/Point";
import VectorLayer from "ol/layer/Vector";
import Cluster from "ol/source/Cluster";
import VectorSource from "ol/source/Vector";
import { Circle, Fill, Stroke, Style, Text } from "ol/style";
import type { Landmark } from "../api/types";
import { stateOf } from "../words/states";
import type { Colours } from "./colours";
import { footprint } from "./geometry";

/** Landmarks nearer than this on the screen are one circle, px. */
const APART_PX = 22;
/** From this resolution on (m per px) all are drawn by themselves. */
const NEAR_M_PER_PX = 0.012;
/** How far in front of its wall a label stands, px. */
const LABEL_PX = 14;
const FONT = "12px Inter, system-ui, sans-serif";

export interface LandmarkLayer {
  layer: VectorLayer;
  /** Draws this landmark as chosen. */
  choose(name: string | undefined): void;
}

export function landmarkLayer(landmarks: readonly Landmark[], colours: Colours): LandmarkLayer {
  const source = new VectorSource<Feature<Point>>();
  for (const landmark of landmarks) {
    if (!landmark.place) continue;
    const feature = new Feature(new Point([landmark.place.x_m, landmark.place.y_m]));
    feature.set("landmark", landmark);
    source.addFeature(feature);
  }
  let chosen: string | undefined;
  const cluster = new Cluster({ source, distance: APART_PX });
  const style = (feature: FeatureLike, resolution: number) => {
    const members = (feature.get("features") ?? [feature]) as Feature<Point>[];
    const found = members.map((member) => member.get("landmark") as Landmark);
    const [one] = found;
    if (!one) return [];
    if (found.length > 1 && resolution > NEAR_M_PER_PX) return [circle(found, colours, found.some(({ name }) => name === chosen))];
    return found.flatMap((landmark) => single(landmark, colours, landmark.name === chosen));
  };
  const layer = new VectorLayer({ source: cluster, style, declutter: "landmarks" });
  return {
    layer,
    choose(name) {
      chosen = name;
      layer.changed();
    },
  };
}

function circle(found: readonly Landmark[], colours: Colours, isChosen: boolean): Style {
  const states = found.map(stateOf);
  const worst = states.find((state) => state === "quarantined") ?? states.find((state) => state === "flagged") ?? states[0] ?? "active";
  return new Style({
    image: new Circle({
      radius: 11,
      fill: new Fill({ color: colours.halo }),
      stroke: new Stroke({ color: isChosen ? colours.accent : colours.state[worst], width: isChosen ? 4 : 2.5 }),
    }),
    text: new Text({ text: String(found.length), font: FONT, fill: new Fill({ color: colours.text }) }),
  });
}

function single(landmark: Landmark, colours: Colours, isChosen: boolean): Style[] {
  const ends = footprint(landmark);
  if (!ends || !landmark.place) return [];
  const { theta_rad } = landmark.place;
  const colour = colours.state[stateOf(landmark)];
  const line = new LineString(ends);
  const styles = [new Style({ geometry: line, stroke: new Stroke({ color: colour, width: 5, lineCap: "butt" }) })];
  if (isChosen) styles.unshift(new Style({ geometry: line, stroke: new Stroke({ color: colours.accent, width: 11 }) }));
  const text = new Text({
    text: landmark.name,
    font: isChosen ? `bold ${FONT}` : FONT,
    fill: new Fill({ color: colours.text }),
    stroke: new Stroke({ color: colours.halo, width: 3 }),
    offsetX: LABEL_PX * Math.cos(theta_rad),
    offsetY: -LABEL_PX * Math.sin(theta_rad),
    textAlign: Math.cos(theta_rad) > 0.5 ? "left" : Math.cos(theta_rad) < -0.5 ? "right" : "center",
  });
  styles.push(new Style({ text, zIndex: isChosen ? 2 : 1 }));
  return styles;
}
