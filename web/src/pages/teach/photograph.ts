// A photograph, and what the server sees in it.
import { MOST_BYTES, pictureOf } from "../../parts/picture";
import { bytes } from "../../words/amounts";
import type { LiveAnswer } from "../../words/quads";

/** Pixels: right, down. */
export type Corner = [number, number];

export interface Photograph {
  file: Blob;
  url: string;
  width: number;
  height: number;
  /** What the page did to it, for people. */
  note?: string;
}

/** Longer side of a photograph that is made smaller, px: more than a model can use of it. */
const LONG_SIDE_PX = 4000;

/** Reads the size of a picture, and makes one smaller that the server would refuse. Errors: it is no picture. */
export async function photographOf(file: Blob): Promise<Photograph> {
  const bitmap = await pictureOf(file);
  try {
    const { width, height } = bitmap;
    if (file.size <= MOST_BYTES) return { file, url: URL.createObjectURL(file), width, height };
    const scale = Math.min(1, LONG_SIDE_PX / Math.max(width, height));
    const canvas = Object.assign(document.createElement("canvas"), { width: Math.round(width * scale), height: Math.round(height * scale) });
    canvas.getContext("2d")?.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
    const smaller = await new Promise<Blob | null>((then) => canvas.toBlob(then, "image/jpeg", 0.92));
    if (!smaller || smaller.size > MOST_BYTES) throw new Error(`This photograph has ${bytes(file.size)}; ${MOST_BYTES / 2 ** 20} MB is the most.`);
    const note = `The file has ${bytes(file.size)}, more than the server takes. It is sent smaller: ${canvas.width} × ${canvas.height} pixels, ${bytes(smaller.size)}.`;
    return { file: smaller, url: URL.createObjectURL(smaller), width: canvas.width, height: canvas.height, note };
  } finally {
    bitmap.close();
  }
}

/** Corners of every quad that was detected, largest first. */
export function proposals(answer: LiveAnswer): Corner[][] {
  const quads = answer.quads.map((quad) => quad.corners.map(({ u_px, v_px }): Corner => [u_px, v_px]));
  return quads.filter((corners) => corners.length === 4).sort((a, b) => area(b) - area(a));
}

/** Area of a polygon, px². */
export function area(corners: readonly Corner[]): number {
  const twice = corners.reduce((sum, [x, y], i) => {
    const [u, v] = corners[(i + 1) % corners.length] ?? [0, 0];
    return sum + x * v - u * y;
  }, 0);
  return Math.abs(twice) / 2;
}
