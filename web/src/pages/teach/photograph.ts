// A photograph, and what the server sees in it.
import type { LiveAnswer } from "../../words/quads";

/** Pixels: right, down. */
export type Corner = [number, number];

export interface Photograph {
  file: Blob;
  url: string;
  width: number;
  height: number;
}

/** Reads the size. Errors: it is no picture. */
export async function photographOf(file: Blob): Promise<Photograph> {
  const bitmap = await createImageBitmap(file).catch(() => {
    throw new Error("This is no picture that can be read. JPEG and PNG can.");
  });
  const { width, height } = bitmap;
  bitmap.close();
  return { file, url: URL.createObjectURL(file), width, height };
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
