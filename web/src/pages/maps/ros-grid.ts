// An occupancy grid of ROS (map_server: a .yaml file beside a .pgm or .png picture) as a floor plan.

export interface GridPlace {
  metres_per_pixel: number;
  x_m: number;
  y_m: number;
  theta_rad: number;
}

/** Where the picture lies, of the .yaml file. Errors: it lacks the resolution or the origin. */
export function placeOf(yaml: string): GridPlace {
  const number = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?";
  const metres_per_pixel = Number(new RegExp(`^resolution:\\s*(${number})\\s*(?:#.*)?$`, "m").exec(yaml)?.[1]);
  // A list in brackets, also over several lines, or one with a dash for each number.
  const list = new RegExp(`^origin:\\s*(?:#.*)?\\n?\\s*\\[([^\\]]*)\\]|^origin:\\s*(?:#.*)?\\n((?:\\s*-\\s+${number}\\s*(?:#.*)?\\n?){2,3})`, "m").exec(`${yaml}\n`);
  const values = (list?.[1] ?? list?.[2] ?? "").match(new RegExp(list?.[1] === undefined ? `(?<=-\\s+)${number}` : number, "g"))?.map(Number) ?? [];
  const [x_m, y_m, theta_rad = 0] = values;
  if (!(metres_per_pixel > 0)) throw new Error("The .yaml file has no `resolution`, the side of a pixel in metres.");
  if (x_m === undefined || y_m === undefined) throw new Error("The .yaml file has no `origin`: [x, y, yaw].");
  return { metres_per_pixel, x_m, y_m, theta_rad };
}

export interface GreyPicture {
  width: number;
  height: number;
  /** Row by row, 0 to 255. */
  grey: Uint8Array;
}

/** A .pgm picture (P5 or P2). Errors: it is none. */
export function pgmOf(bytes: Uint8Array): GreyPicture {
  let at = 0;
  const word = (): string => {
    for (;;) {
      while (at < bytes.length && (bytes[at] ?? 0) <= 32) at++;
      if (bytes[at] !== 35) break;
      while (at < bytes.length && bytes[at] !== 10) at++;
    }
    const begun = at;
    while (at < bytes.length && (bytes[at] ?? 0) > 32) at++;
    return String.fromCharCode(...bytes.subarray(begun, at));
  };
  const [kind, width, height, most] = [word(), Number(word()), Number(word()), Number(word())];
  if ((kind !== "P5" && kind !== "P2") || !(width > 0 && height > 0 && most > 0 && most < 65_536)) throw new Error("This is no .pgm picture.");
  const grey = new Uint8Array(width * height);
  if (kind === "P2") {
    for (let i = 0; i < grey.length; i++) grey[i] = Math.round((255 * Number(word())) / most);
    return { width, height, grey };
  }
  const [start, deep] = [at + 1, most > 255 ? 2 : 1];
  if (bytes.length < start + grey.length * deep) throw new Error("The .pgm picture ends too early.");
  for (let i = 0; i < grey.length; i++) {
    const value = deep === 2 ? 256 * (bytes[start + 2 * i] ?? 0) + (bytes[start + 2 * i + 1] ?? 0) : (bytes[start + i] ?? 0);
    grey[i] = Math.round((255 * value) / most);
  }
  return { width, height, grey };
}

/** A .pgm picture as PNG, which is what the server takes. */
async function png({ width, height, grey }: GreyPicture): Promise<Blob> {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const pen = canvas.getContext("2d");
  if (!pen) throw new Error("This browser cannot draw the picture.");
  const image = pen.createImageData(width, height);
  grey.forEach((value, i) => image.data.set([value, value, value, 255], 4 * i));
  pen.putImageData(image, 0, 0);
  const made = await new Promise<Blob | null>((then) => canvas.toBlob(then, "image/png"));
  if (!made) throw new Error("This browser cannot make a PNG of the picture: it may be too large.");
  return made;
}

/** The picture, and the place if there is a .yaml file among the files. */
export async function planOf(files: readonly File[]): Promise<{ picture: Blob | undefined; place: GridPlace | undefined }> {
  const yaml = files.find(({ name }) => /\.ya?ml$/i.test(name));
  const image = files.find((file) => file !== yaml);
  const is_pgm = image !== undefined && /\.pgm$/i.test(image.name);
  const picture = is_pgm ? await png(pgmOf(new Uint8Array(await image.arrayBuffer()))) : image;
  return { picture, place: yaml && placeOf(await yaml.text()) };
}
