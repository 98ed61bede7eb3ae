// Measures the page of a large map: 2 000 landmarks, 20 000 wall segments, 50 robots whose poses arrive all the time.
// Prints figures and asserts none: `node tests/scale.js`. WAYMARK_PROGRAM names the program, which is to be a release build;
// WAYMARK_PYTHON a Python with the package of client/python.
import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { browser, serve } from "./journeys/harness.js";

const PYTHON = process.env.WAYMARK_PYTHON ?? new URL("../../target/python/bin/python", import.meta.url).pathname;
// Less of everything, to try the measurement itself: WAYMARK_SCALE=0.02.
const SHARE = Number(process.env.WAYMARK_SCALE ?? 1);
const [ROBOTS, LANDMARKS, SEGMENTS] = [50, 2000, 20_000].map((number) => Math.max(1, Math.round(number * SHARE)));
const [WIDE, DEEP] = [200, 100];

/** Starts the robots, and waits until they are connected. */
async function drive(endpoint) {
  const child = spawn(PYTHON, [new URL("scale-robots.py", import.meta.url).pathname, endpoint, String(ROBOTS)], { stdio: ["ignore", "pipe", "inherit"] });
  await new Promise((done, failed) => {
    child.stdout.once("data", done);
    child.once("exit", (code) => failed(new Error(`the robots have ended with ${code}`)));
  });
  return child;
}

/** 20 000 short walls in rows, 2 000 landmarks on them, robots. */
async function build(api) {
  await api("POST", "/maps", { name: "big" });
  const segments = Array.from({ length: SEGMENTS }, (_, i) => {
    const [x, y] = [(i % 200) * (WIDE / 200), Math.floor(i / 200) * (DEEP / 100)];
    return { a: [x, y], b: [x + 0.8, y] };
  });
  await api("PUT", "/maps/big/walls", { segments });
  const place = (i) => ({ x_m: (i % 100) * 2 + 0.4, y_m: Math.floor(i / 100) * 5 + 0.02, z_m: 1.5, theta_rad: Math.PI / 2, roll_rad: 0, tilt_rad: 0 });
  const landmarks = Array.from({ length: LANDMARKS }, (_, i) => ({ name: `sign-${i}`, size: { width_m: 0.6, height_m: 0.8 }, place: place(i) }));
  await api("POST", "/maps/big/bulk/create-landmarks", { landmarks });
  for (let i = 0; i < ROBOTS; i++) await api("PUT", `/robots/r${i}`, { map: "big" });
}

/** Memory of a process, MB. */
function memory(process) {
  let text = "";
  try {
    text = readFileSync(`/proc/${process}/smaps_rollup`, "utf8");
  } catch {
    // It has ended meanwhile.
  }
  const sum = (names) => [...text.matchAll(new RegExp(`^(?:${names}):\\s+(\\d+) kB`, "gm"))].reduce((all, [, kb]) => all + Number(kb) / 1000, 0);
  return { resident: sum("Rss"), private: sum("Private_Clean|Private_Dirty") };
}

/** Pictures a second while the map is dragged, over `ms`. */
async function pan(page, ms) {
  const box = await page.getByRole("application").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.evaluate(() => {
    if (globalThis.pictures_drawn !== undefined) return;
    globalThis.pictures_drawn = 0;
    const tick = () => {
      globalThis.pictures_drawn += 1;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  });
  await page.mouse.move(x, y);
  await page.mouse.down();
  const begun = performance.now();
  const before = await page.evaluate(() => globalThis.pictures_drawn);
  for (let i = 0; performance.now() - begun < ms; i++) await page.mouse.move(x + 150 * Math.sin(i / 15), y + 80 * Math.cos(i / 20));
  const drawn = (await page.evaluate(() => globalThis.pictures_drawn)) - before;
  const seconds = (performance.now() - begun) / 1000;
  await page.mouse.up();
  return drawn / seconds;
}

const data = mkdtempSync(join(tmpdir(), "waymark-scale-"));
const ended = [];
// Whatever hangs, this ends: the figures are of a minute.
const MOST_MS = 240_000;
const late = setTimeout(() => {
  console.error(`not ended within ${MOST_MS / 1000} s`);
  for (const end of ended.reverse()) end();
  process.exit(1);
}, MOST_MS);
late.unref();
const step = (text) => console.log(`${(performance.now() / 1000).toFixed(1)} s: ${text}`);
try {
  const server = await serve("--data", data, "--zenoh", "tcp/127.0.0.1:0");
  ended.push(server.stop);
  step("the server runs");
  const { origin } = server;
  const its = await browser(server);
  ended.push(() => its.close());
  const api = async (method, path, body) => {
    const headers = { "x-waymark-page": "1", "if-match": "*" };
    const answer = await its.context.request.fetch(`${origin}/api/v1${path}`, { method, headers, ...(body && { data: body }), timeout: 120_000 });
    if (!answer.ok()) throw new Error(`${method} ${path}: ${answer.status()} ${await answer.text()}`);
    return answer.status() === 204 ? undefined : answer.json();
  };
  await build(api);
  step("the map is built");
  const robots = await drive(server.robots);
  ended.push(() => robots.kill("SIGKILL"));
  step("the robots are connected");
  await new Promise((done) => setTimeout(done, 3000));
  for (let i = 0; i < ROBOTS; i++) await api("PUT", `/robots/r${i}/pose`, { x_m: 2 + 4 * (i % 25), y_m: 20.5 + 40 * Math.floor(i / 25), theta_rad: 0 });
  step("the robots have poses");

  const page = await its.context.newPage();
  page.setDefaultTimeout(30_000);
  page.on("console", (message) => message.type() === "error" && console.error(message.text()));
  const first = performance.now();
  await page.goto(`${origin}/maps/big`);
  await page.getByText(`${LANDMARKS.toLocaleString("en")} landmark`).first().waitFor({ timeout: 60_000 });
  const shown_ms = performance.now() - first;
  const paint_ms = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
  step("the map is shown");
  await page.waitForTimeout(3000);
  const live = await page.getByText("Live", { exact: true }).count();
  const far = await pan(page, 5000);
  step("panned over the whole map");
  for (let i = 0; i < 5; i++) {
    await page.getByRole("button", { name: "Zoom in" }).click();
    await page.waitForTimeout(300);
  }
  await page.waitForTimeout(1000);
  const near = await pan(page, 5000);
  step("panned near");
  const cdp = await its.context.newCDPSession(page);
  await cdp.send("Performance.enable");
  const { metrics } = await cdp.send("Performance.getMetrics");
  const heap = metrics.find(({ name }) => name === "JSHeapUsedSize").value;
  // The largest process that draws a page: what it has resident, and what of that is its own, not the browser's program.
  const renderers = execFileSync("pgrep", ["-f", "type=renderer"], { encoding: "utf8" }).trim().split("\n").map(memory);
  const largest = renderers.reduce((a, b) => (b.resident > a.resident ? b : a));
  console.log(`robots live on the page: ${live} of ${ROBOTS}`);
  console.log(`first paint after ${paint_ms?.toFixed(0)} ms, the whole map after ${shown_ms.toFixed(0)} ms`);
  console.log(`while panning, pictures a second: ${far.toFixed(1)} (whole map), ${near.toFixed(1)} (near)`);
  console.log(`script heap ${(heap / 1e6).toFixed(0)} MB; the page's process ${largest.private.toFixed(0)} MB of its own, ${largest.resident.toFixed(0)} MB resident`);
} finally {
  for (const end of ended.reverse()) await end();
  rmSync(data, { recursive: true, force: true });
}
process.exit(0);
