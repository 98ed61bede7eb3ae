// What the server takes as a picture.

/** The most bytes, as it is set up by default (`limits.upload_bytes`). */
export const MOST_BYTES = 2 ** 24;

/** Decodes a picture. Errors: it is none. */
export const pictureOf = (file: Blob): Promise<ImageBitmap> =>
  createImageBitmap(file).catch(() => {
    throw new Error("This file is not a readable image. Use JPEG or PNG.");
  });
