// Numbers for people.

export const metres = (value: number) => `${value.toFixed(2)} m`;

export const degrees = (rad: number) => `${((((rad * 180) / Math.PI) % 360) + 360) % 360 < 359.5 ? Math.round(((((rad * 180) / Math.PI) % 360) + 360) % 360) : 0}°`;

export const percent = (share: number) => `${Math.round(100 * share)} %`;

export function bytes(count: number): string {
  if (count < 1e3) return `${count} B`;
  if (count < 1e6) return `${(count / 1e3).toFixed(0)} kB`;
  if (count < 1e9) return `${(count / 1e6).toFixed(1)} MB`;
  return `${(count / 1e9).toFixed(2)} GB`;
}

/** A time, as this browser's language has it. */
export const time = (ms: number) => new Date(ms).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" });

/** How long ago. */
export function ago(ms: number): string {
  const s = ms / 1000;
  if (s < 1.5) return "now";
  if (s < 90) return `${Math.round(s)} s ago`;
  if (s < 5400) return `${Math.round(s / 60)} min ago`;
  if (s < 129_600) return `${Math.round(s / 3600)} h ago`;
  return `${Math.round(s / 86_400)} days ago`;
}

/** "1 landmark", "3 landmarks". */
export const count = (number: number, one: string, many = `${one}s`) => `${number.toLocaleString("en")} ${number === 1 ? one : many}`;
