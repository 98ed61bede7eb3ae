// The floor from above, in metres: an OpenLayers map with its layers, and what can be done on it.
import OlMap from "ol/Map";
import View from "ol/View";
import { ScaleLine } from "ol/control";
import { DragRotate, Pointer, defaults as interactions } from "ol/interaction";
import { altKeyOnly } from "ol/events/condition";
import type BaseLayer from "ol/layer/Base";
import Graticule from "ol/layer/Vector";
import Feature from "ol/Feature";
import MultiLineString from "ol/geom/MultiLineString";
import Projection from "ol/proj/Projection";
import { addProjection } from "ol/proj";
import VectorSource from "ol/source/Vector";
import { Stroke, Style } from "ol/style";
import type { Bounds, Point } from "./geometry";

/** Metres on the floor, y upwards. */
export const METRES = "waymark-metres";
const FAR_M = 1e5;
/** A pointer that moves less between press and release has clicked, px. */
const CLICK_PX = 6;
/** A single click is known as one after less than this, ms. */
const DOUBLE_MS = 600;

const projection = new Projection({ code: METRES, units: "m", extent: [-FAR_M, -FAR_M, FAR_M, FAR_M] });
projection.setGetPointResolution((resolution) => resolution);
addProjection(projection);

export interface FloorEvents {
  /** A landmark or a robot was clicked, or the bare floor. */
  onpick(picked: { landmark?: string; robot?: string; at: Point }): void;
  /** The pointer is over this point, without a button. */
  onhover?(at: Point): void;
  /** The view has moved: centre, m per px, turn. */
  onmove(view: string): void;
}

export class Floor {
  readonly map: OlMap;
  /** While this is set, a drag over the floor is told to it, and does not move the map. */
  aim: ((from: Point, to: Point, is_done: boolean, is_first: boolean) => void) | undefined;
  /** While this is set, every click is told at once: none waits for a second one that would zoom. */
  is_quick = false;
  #grid = new Graticule({ source: new VectorSource(), zIndex: -1 });

  constructor(target: HTMLElement, events: FloorEvents) {
    const view = new View({ projection, center: [0, 0], resolution: 0.05, minResolution: 0.001, maxResolution: 2, constrainResolution: false });
    const controls = [new ScaleLine({ units: "metric", minWidth: 80 })];
    this.map = new OlMap({
      target,
      view,
      controls,
      keyboardEventTarget: target,
      interactions: interactions({ onFocusOnly: false }).extend([new DragRotate({ condition: altKeyOnly }), this.#aiming()]),
    });
    this.map.updateSize();
    this.map.addLayer(this.#grid);
    const point = (coordinate: number[]): Point => [coordinate[0] ?? 0, coordinate[1] ?? 0];
    this.map.on("pointermove", ({ dragging, coordinate }) => !dragging && events.onhover?.(point(coordinate)));
    let told_ms = -Infinity;
    this.map.on("click", ({ coordinate }) => {
      if (!this.is_quick) return;
      told_ms = performance.now();
      events.onpick({ at: point(coordinate) });
    });
    this.map.on("dblclick", () => !this.is_quick);
    this.map.on("singleclick", ({ pixel, coordinate }) => {
      // It comes late: what was told by then is not told once more.
      if (this.is_quick || performance.now() - told_ms < DOUBLE_MS) return;
      const at = point(coordinate);
      let picked: { landmark?: string; robot?: string } = {};
      this.map.forEachFeatureAtPixel(pixel, (feature) => {
        const members = (feature.get("features") ?? [feature]) as Feature[];
        const landmark = members.length === 1 ? (members[0]?.get("landmark") as { name: string } | undefined)?.name : undefined;
        const robot = feature.get("robot") as string | undefined;
        if (members.length > 1) this.#nearer(members);
        else if (robot !== undefined) picked = { robot };
        else if (landmark !== undefined) picked = { landmark };
        return members.length > 1 || robot !== undefined || landmark !== undefined;
      }, { hitTolerance: 6 });
      events.onpick({ ...picked, at });
    });
    this.map.on("moveend", () => {
      this.#drawGrid();
      const [x = 0, y = 0] = view.getCenter() ?? [];
      events.onmove([x.toFixed(2), y.toFixed(2), (view.getResolution() ?? 1).toPrecision(4), view.getRotation().toFixed(3)].join(","));
    });
  }

  #aiming(): Pointer {
    let from: { at: Point; pixel: number[] } | undefined;
    let is_drag = false;
    const point = ([x = 0, y = 0]: number[]): Point => [x, y];
    return new Pointer({
      handleDownEvent: ({ coordinate, pixel, originalEvent }) => {
        from = { at: point(coordinate), pixel };
        is_drag = false;
        return this.aim !== undefined && !originalEvent.altKey && (!("isPrimary" in originalEvent) || originalEvent.isPrimary);
      },
      handleDragEvent: ({ coordinate, pixel }) => {
        if (!from) return;
        const was_drag = is_drag;
        is_drag ||= Math.hypot((pixel[0] ?? 0) - (from.pixel[0] ?? 0), (pixel[1] ?? 0) - (from.pixel[1] ?? 0)) > CLICK_PX;
        if (is_drag) this.aim?.(from.at, point(coordinate), false, !was_drag);
      },
      handleUpEvent: ({ coordinate }) => {
        if (from && is_drag) this.aim?.(from.at, point(coordinate), true, false);
        from = undefined;
        return false;
      },
    });
  }

  /** Metres of a pixel. */
  get px_m(): number {
    return this.map.getView().getResolution() ?? 1;
  }

  /** Shows these bounds, with a margin. */
  fit(bounds: Bounds): void {
    const [width = 0, height = 0] = this.map.getSize() ?? [];
    this.map.getView().fit(bounds, { size: [width, height], padding: [48, 48, 48, 48], minResolution: 0.005 });
  }

  /** Goes back to a view of `onmove`. Whether it is one. */
  restore(text: string | null): boolean {
    const [x, y, resolution, turn] = (text ?? "").split(",").map(Number);
    if (![x, y, resolution, turn].every((value) => Number.isFinite(value))) return false;
    const view = this.map.getView();
    view.setCenter([x as number, y as number]);
    view.setResolution(resolution);
    view.setRotation(turn as number);
    return true;
  }

  zoom(factor: number): void {
    const view = this.map.getView();
    view.animate({ resolution: (view.getResolution() ?? 1) / factor, duration: 150 });
  }

  turn(by_rad: number): void {
    const view = this.map.getView();
    view.animate({ rotation: by_rad === 0 ? 0 : view.getRotation() + by_rad, duration: 150 });
  }

  centre(at: Point): void {
    this.map.getView().animate({ center: at, duration: 200 });
  }

  put(layer: BaseLayer): void {
    this.map.addLayer(layer);
  }

  take(layer: BaseLayer): void {
    this.map.removeLayer(layer);
  }

  close(): void {
    this.map.setTarget(undefined);
    this.map.dispose();
  }

  #nearer(members: Feature[]): void {
    const source = new VectorSource({ features: members });
    const extent = source.getExtent();
    if (extent) this.map.getView().fit(extent, { padding: [80, 80, 80, 80], minResolution: 0.004, duration: 200 });
  }

  /** Lines a round number of metres apart, over what is seen. */
  #drawGrid(): void {
    const view = this.map.getView();
    const resolution = view.getResolution() ?? 1;
    const step = [0.5, 1, 2, 5, 10, 20, 50, 100, 200].find((step) => step / resolution >= 40) ?? 500;
    const [west = 0, south = 0, east = 0, north = 0] = view.calculateExtent(this.map.getSize());
    const lines: number[][][] = [];
    for (let x = Math.ceil(west / step) * step; x <= east; x += step) lines.push([[x, south], [x, north]]);
    for (let y = Math.ceil(south / step) * step; y <= north; y += step) lines.push([[west, y], [east, y]]);
    const source = this.#grid.getSource();
    source?.clear(true);
    source?.addFeature(new Feature(new MultiLineString(lines)));
    this.#grid.setStyle(new Style({ stroke: new Stroke({ color: "#8090a838", width: 1 }) }));
  }
}
