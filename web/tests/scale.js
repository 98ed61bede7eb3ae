// Measures the page of a large map: 2 000 landmarks, 20 000 wall segments, 50 robots whose poses arrive all the time.
// Prints figures and asserts none: `node tests/scale.js`. WAYMARK_PROGRAM names the program, a release build.
import { execFileSync } from "node:child_process";
import { browser, demo } from "./journeys/harness.js";

const ROBOTS = 50;
const [WIDE, DEEP] = [200, 100];

const server = await demo(["--robots", String(ROBOTS), "--rate-hz", "0.2"]);
const its = await browser(server);
const api = async (method, path, body) => {
  const headers = { "x-waymark-page": "1", "if-match": "*" };
  const answer = await its.context.request.fetch(`${server.origin}/api/v1${path}`, { method, headers, ...(body && { data: body }), timeout: 120_000 });
  if (!answer.ok()) throw new Error(`${method} ${path}: ${answer.status()} ${await answer.text()}`);
  return answer.status() === 204 ? undefined : answer.json();
};

/** 20 000 short walls in rows, and 2 000 landmarks on them. */
async function build() {
  await api("POST", "/maps", { name: "big" });
  const segments = Array.from({ length: 20_000 }, (_, i) => {
    const [x, y] = [(i % 200) * (WIDE / 200), Math.floor(i / 200) * (DEEP / 100)];
    return { a: [x, y], b: [x + 0.8, y] };
  });
  await api("PUT", "/maps/big/walls", { segments });
  const place = (i) => ({ x_m: (i % 100) * 2 + 0.4, y_m: Math.floor(i / 100) * 5 + 0.02, z_m: 1.5, theta_rad: Math.PI / 2, roll_rad: 0, tilt_rad: 0 });
  const landmarks = Array.from({ length: 2000 }, (_, i) => ({ name: `sign-${i}`, size: { width_m: 0.6, height_m: 0.8 }, place: place(i) }));
  await api("POST", "/maps/big/bulk/create-landmarks", { landmarks });
  const robots = (await api("GET", "/robots?limit=100")).items;
  for (const [i, { name }] of robots.entries()) {
    await api("PUT", `/robots/${name}`, { map: "big" });
    await api("PUT", `/robots/${name}/pose`, { x_m: 4 * i, y_m: 2 * i + 0.5, theta_rad: 0 }).catch((error) => console.log(`${name}: ${error.message}`));
  }
  return robots.length;
}

/** Pictures a second while the map is dragged, over `ms`. */
async function pan(page, ms) {
  const box = await page.getByRole("application").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.evaluate(() => {
    globalThis.frames_drawn = 0;
    const tick = () => {
      globalThis.frames_drawn += 1;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  });
  await page.mouse.move(x, y);
  await page.mouse.down();
  const begun = performance.now();
  const before = await page.evaluate(() => globalThis.frames_drawn);
  for (let i = 0; performance.now() - begun < ms; i++) await page.mouse.move(x + 150 * Math.sin(i / 15), y + 80 * Math.cos(i / 20));
  const drawn = (await page.evaluate(() => globalThis.frames_drawn)) - before;
  const seconds = (performance.now() - begun) / 1000;
  await page.mouse.up();
  return drawn / seconds;
}

const robots = await build();
const page = await its.context.newPage();
const first = performance.now();
await page.goto(`${server.origin}/maps/big`);
await page.getByText("2,000 landmarks, 20,000 wall segments").waitFor();
const shown_ms = performance.now() - first;
const paint_ms = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
const live = await page.getByText("Live", { exact: true }).count();
await page.waitForTimeout(3000);
const far = await pan(page, 4000);
for (let i = 0; i < 5; i++) await page.getByRole("button", { name: "Zoom in" }).click();
await page.waitForTimeout(1000);
const near = await pan(page, 4000);
const cdp = await its.context.newCDPSession(page);
const metrics = Object.fromEntries((await cdp.send("Performance.enable"), await cdp.send("Performance.getMetrics")).metrics.map(({ name, value }) => [name, value]));
const rss = execFileSync("ps", ["-eo", "rss,args"], { encoding: "utf8" }).split("\n").filter((line) => line.includes("--type=renderer")).map((line) => Number(line.trim().split(" ")[0]) / 1000);
console.log(`robots ${robots}, live at once ${live}`);
console.log(`first paint ${paint_ms?.toFixed(0)} ms, map shown ${shown_ms.toFixed(0)} ms`);
console.log(`panning, whole map: ${far.toFixed(1)} pictures a second; near: ${near.toFixed(1)}`);
console.log(`script heap ${(metrics.JSHeapUsedSize / 1e6).toFixed(0)} MB; largest renderer process ${Math.max(...rss).toFixed(0)} MB`);
await its.close();
await server.stop();
process.exit(0);
