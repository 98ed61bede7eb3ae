// The floor plan beneath the map: a picture with a scale, turned about its lower left corner.
import ImageLayer from "ol/layer/Image";
import ImageCanvasSource from "ol/source/ImageCanvas";
import type { Underlay } from "../api/types";

export interface Plan {
  underlay: Underlay;
  picture: ImageBitmap;
}

export function underlayLayer({ underlay: { place }, picture }: Plan, projection: string): ImageLayer<ImageCanvasSource> {
  const canvas = document.createElement("canvas");
  const canvasFunction = (extent: number[], resolution: number, pixelRatio: number, size: number[]) => {
    const [west = 0, , , north = 0] = extent;
    [canvas.width = 1, canvas.height = 1] = size.map(Math.round);
    const c = canvas.getContext("2d");
    if (!c) return canvas;
    const scale = pixelRatio / resolution;
    const pixel = place.metres_per_pixel * scale;
    c.translate((place.x_m - west) * scale, (north - place.y_m) * scale);
    c.rotate(-place.theta_rad);
    c.imageSmoothingEnabled = pixel < 2;
    c.drawImage(picture, 0, -picture.height * pixel, picture.width * pixel, picture.height * pixel);
    return canvas;
  };
  return new ImageLayer({ source: new ImageCanvasSource({ canvasFunction, projection, ratio: 1 }), opacity: 0.6 });
}
