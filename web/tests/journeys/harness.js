// What every journey needs: the real server with driving robots, a browser, and checks that hold on every page: no error in
// the console, no request to another origin, nothing serious from axe-core, nothing wider than the screen.
import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, afterEach, before } from "node:test";
import { promisify } from "node:util";
import { chromium } from "playwright-core";

export const PROGRAM = process.env.WAYMARK_PROGRAM ?? new URL("../../../target/debug/waymark", import.meta.url).pathname;
const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";
const OUTPUT = new URL("../output/", import.meta.url).pathname;
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const GUIDE = new URL("../../../docs/pictures/pages/", import.meta.url).pathname;
/** The pictures that docs/guides/administrator.md shows. */
const PICTURES = new Set([...readFileSync(new URL("../../../docs/guides/administrator.md", import.meta.url), "utf8").matchAll(/pictures\/pages\/([a-z-]+)\.webp/g)].map((found) => found[1]));
/** A picture of the guide has at most so many bytes; its quality is lowered until it has. */
const MOST_BYTES = 60_000;
/** Time for anything that a journey waits for, ms: two cores are shared with driving robots. */
export const SOON = 90_000;

export const DESKTOP = { width: 1280, height: 800 };
export const PHONE = { width: 390, height: 844 };

/**
 * What the journeys of a file have: a server of their own, started with a folder, a browser that is signed in, and what `begin`
 * makes before the first. All of it is ended and removed after the last. Open pages hold streams, and a browser has six
 * connections to a server: each journey's are closed.
 */
export function journeys({ start = plain, begin = async () => {} } = {}) {
  const world = {
    /** Asks the API as the page does, with the session of the browser. */
    api: (...asked) => world.ask(...asked),
    go: (address, size) => open(world.context, world.origin, address, size),
  };
  before(async () => {
    world.folder = mkdtempSync(join(tmpdir(), "waymark-journeys-"));
    world.server = await start(world.folder);
    Object.assign(world, await signedIn(world.server));
    await begin(world);
  });
  after(async () => {
    await world.close?.();
    await world.server?.stop();
    if (world.folder) rmSync(world.folder, { recursive: true, force: true });
  });
  afterEach(() => Promise.all(world.context.pages().map((page) => page.close())));
  return world;
}

/** A server without robots. */
export const plain = (folder, ...args) => serve("--data", join(folder, "data"), "--zenoh", "tcp/127.0.0.1:0", ...args);

/** A browser of a server: its address, how it asks the API, and how it is closed. */
export async function signedIn(server) {
  const its = await browser(server);
  return { origin: server.origin, context: its.context, close: its.close, ask: asker(its, server) };
}

/** Starts `waymark demo --stay`: a corridor whose posters are taught, and robots that drive. */
export async function demo() {
  const { found, stop } = await started(["demo", "--stay", "--legs", "40", "--robots", "2", "--rate-hz", "1", "--http", "127.0.0.1:0"], /https?:\/\/[^\s/]+\/open\?code=\S+/);
  return { link: found[0], origin: new URL(found[0]).origin, stop };
}

/** Starts `waymark serve`. It prints no link where no person reads: its token gives one. */
export async function serve(...args) {
  const http = args.includes("--http") ? [] : ["--http", "127.0.0.1:0"];
  const { found, stop, kill } = await started(["serve", ...http, ...args], /pages\s+\S+:(\d+)\/\s+robots\s+(\S+)\s+token\s+(\S+)\n/);
  const [, port, robots, file] = found;
  // With encryption, too, plain text is served to this machine.
  const origin = `http://127.0.0.1:${port}`;
  const headers = { authorization: `Bearer ${readFileSync(file, "utf8").trim()}` };
  const answer = await fetch(`${origin}/api/v1/session/links`, { method: "POST", headers });
  assert.ok(answer.ok, `a link: ${answer.status} ${await answer.clone().text()}`);
  return { link: `${origin}${(await answer.json()).path}`, origin, robots, stop, kill };
}

/** Runs a command of the program to its end. */
export const run = (args, options = {}) => promisify(execFile)(PROGRAM, args, { env: clean(), timeout: SOON, ...options });

/** Without settings of the program: the server takes variables of this prefix for its own. */
export const clean = () => Object.fromEntries(Object.entries(process.env).filter(([name]) => !name.startsWith("WAYMARK_")));

/** Starts the program, and waits until it says this. */
async function started(args, says) {
  const child = spawn(PROGRAM, args, { stdio: ["ignore", "pipe", "pipe"], env: clean() });
  let said = "";
  const found = await new Promise((done, failed) => {
    const hear = (text) => {
      // What is said afterwards is read and dropped: a full pipe would stop the server.
      if (said === undefined) return;
      said += text;
      const match = says.exec(said);
      if (!match) return;
      done(match);
      said = undefined;
    };
    child.stdout.setEncoding("utf8").on("data", hear);
    child.stderr.setEncoding("utf8").on("data", hear);
    child.on("exit", (code) => failed(new Error(`the server has ended with ${code}: ${said}`)));
    setTimeout(() => failed(new Error(`it did not say ${says} within 5 min: ${said}`)), 300_000).unref();
  });
  const stop = () => new Promise((ended) => {
    child.removeAllListeners("exit");
    child.on("exit", ended);
    child.kill("SIGINT");
    setTimeout(() => child.kill("SIGKILL"), 20_000).unref();
  });
  /** As a power cut does. */
  const kill = () => new Promise((ended) => {
    child.removeAllListeners("exit");
    child.on("exit", ended);
    child.kill("SIGKILL");
  });
  return { found, stop, kill };
}

/** A browser that is signed in by a link. */
export async function browser({ link, origin }) {
  const args = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"];
  const launched = await chromium.launch({ executablePath: CHROMIUM, args });
  const context = await launched.newContext({ viewport: DESKTOP, baseURL: origin, ignoreHTTPSErrors: true });
  const first = await context.newPage();
  await first.goto(link);
  await first.close();
  // After the link, whose answer leads on to a page.
  if (process.env.WAYMARK_PAGES) await replaced(context, process.env.WAYMARK_PAGES);
  return { context, close: () => launched.close() };
}

/** Another browser of the same server, in which nobody is signed in. */
export async function guestOf({ context, origin }) {
  const guest = await context.browser().newContext({ viewport: DESKTOP, baseURL: origin, ignoreHTTPSErrors: true });
  if (process.env.WAYMARK_PAGES) await replaced(guest, process.env.WAYMARK_PAGES);
  return guest;
}

/** Takes the pages from a folder (`dist`), and the guides from docs, instead of those in the program: while pages are changed, that spares building it. */
async function replaced(context, folder) {
  const kinds = { js: "text/javascript", css: "text/css" };
  await context.route(({ pathname }) => pathname.startsWith("/assets/"), (route) => {
    const { pathname } = new URL(route.request().url());
    return route.fulfill({ body: readFileSync(folder + pathname), contentType: kinds[pathname.split(".").at(-1)] });
  });
  await context.route(({ pathname }) => pathname.startsWith("/guides/"), (route) => {
    const name = new URL(route.request().url()).pathname.replace("/guides/", "");
    const [file] = [`guides/${name}`, name].map((path) => new URL(`../../../docs/${path}`, import.meta.url)).filter(existsSync);
    return file ? route.fulfill({ body: readFileSync(file), contentType: "text/markdown; charset=utf-8" }) : route.fulfill({ status: 404 });
  });
  await context.route(({ pathname }) => !/^\/(assets|api|open|icon|guides)/.test(pathname), async (route) => {
    const headers = (await route.fetch()).headers();
    return route.fulfill({ body: readFileSync(`${folder}/index.html`), headers });
  });
}

/** A map `hall` without robots: two walls and a landmark that is learnt of one picture. */
export async function hall({ context, origin, api }) {
  await api("POST", "/maps", { name: "hall" });
  await api("PUT", "/maps/hall/walls", { segments: [{ a: [-4, 2], b: [4, 2] }, { a: [-4, -2], b: [4, -2] }] }, { "if-match": "*" });
  const page = await context.newPage();
  await page.goto(origin);
  const picture = await page.evaluate(() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 300, height: 300 });
    const pen = canvas.getContext("2d");
    for (let i = 0; i < 400; i++) {
      pen.fillStyle = `rgb(${(i * 97) % 256},${(i * 57) % 256},${(i * 31) % 256})`;
      pen.fillRect((i * 53) % 300, (i * 37) % 300, 30, 20);
    }
    return canvas.toDataURL("image/png").split(",")[1];
  });
  await page.close();
  const photograph = Buffer.from(picture, "base64");
  const answer = await uploaded(context, origin, "poster", photograph, { whole_image: "true", create: "true", width_m: "0.6", height_m: "0.6" });
  assert.equal(answer.status(), 201, await answer.text());
  const place = { x_m: 0, y_m: 2, z_m: 1.4, theta_rad: -Math.PI / 2, roll_rad: 0, tilt_rad: 0 };
  await api("PATCH", "/maps/hall/landmarks/poster", { place }, { "if-match": "*" });
  await learnt(api, "poster");
  return photograph;
}

/** Has a landmark of the map `hall` learnt. */
export async function learnt(api, landmark) {
  const { id } = await api("POST", `/maps/hall/landmarks/${landmark}/learn`, {});
  await eventually("end of the lesson", async () => (await api("GET", `/jobs/${id}`)).state === "done");
}

/** Sends a photograph of a landmark of the map `hall`. */
export const uploaded = (context, origin, landmark, buffer, parts = {}) =>
  context.request.post(`${origin}/api/v1/maps/hall/landmarks/${landmark}/views`, {
    headers: { "x-waymark-page": "1", connection: "close" },
    multipart: { image: { name: "photo.png", mimeType: "image/png", buffer }, ...parts },
  });

/** A floor plan of 20 m by 12 m: a room, its outline drawn 1 m inside of the picture. */
export async function roomPlan({ context, origin }) {
  const page = await context.newPage();
  await page.goto(origin);
  const base64 = await page.evaluate(() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 400, height: 240 });
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, 400, 240);
    pen.lineWidth = 4;
    pen.strokeRect(20, 20, 360, 200);
    return canvas.toDataURL("image/png").split(",")[1];
  });
  await page.close();
  return Buffer.from(base64, "base64");
}

/** Lays a plan of 5 cm a pixel beneath a map. */
export async function layPlan({ context, origin }, map, buffer, [x_m, y_m] = ["0", "0"]) {
  const multipart = { image: { name: "plan.png", mimeType: "image/png", buffer }, metres_per_pixel: "0.05", x_m, y_m };
  const answer = await context.request.put(`${origin}/api/v1/maps/${map}/underlay`, { headers: { "x-waymark-page": "1", "if-match": "*" }, multipart });
  assert.ok(answer.ok(), await answer.text());
}

/** How many pixels of a part of a page have about this colour, [r, g, b]. */
export async function pixels(part, colour) {
  // Without what lies over the map.
  const over = (visibility) => part.page().evaluate((visibility) => document.querySelectorAll(".floor > :not(.canvas)").forEach((one) => (one.style.visibility = visibility)), visibility);
  await over("hidden");
  const shot = await part.screenshot();
  await over("");
  return part.page().evaluate(
    async ([base64, [r, g, b]]) => {
      const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
      const picture = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
      const canvas = Object.assign(document.createElement("canvas"), { width: picture.width, height: picture.height });
      const pen = canvas.getContext("2d");
      pen.drawImage(picture, 0, 0);
      const { data } = pen.getImageData(0, 0, canvas.width, canvas.height);
      let found = 0;
      for (let i = 0; i < data.length; i += 4) found += Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 40;
      return found;
    },
    [shot.toString("base64"), colour],
  );
}

/**
 * Asks the API as the page does, with the session of the browser. Each request has a connection of its own: the server closes one
 * that was idle for 5 s, and unlike a browser this client does not ask again where that meets its next request.
 */
export const asker = ({ context }, { origin }) => async (method, path, body, headers = {}) => {
  const answer = await context.request.fetch(`${origin}/api/v1${path}`, {
    method,
    headers: { "x-waymark-page": "1", connection: "close", ...headers },
    ...(body && { data: body }),
  });
  assert.ok(answer.ok(), `${method} ${path}: ${answer.status()} ${await answer.text()}`);
  return answer.status() === 204 ? undefined : answer.json();
};

/** Asks again until there is an answer. */
export async function eventually(what, ask) {
  const until = Date.now() + SOON;
  for (;;) {
    const found = await ask();
    if (found) return found;
    assert.ok(Date.now() < until, `there is no ${what} within ${SOON / 1000} s`);
    await new Promise((later) => setTimeout(later, 500));
  }
}

/** Opens an address, and collects what may not happen. */
export async function open(context, origin, address, size = DESKTOP) {
  const page = await context.newPage();
  page.setDefaultTimeout(SOON);
  await page.setViewportSize(size);
  const faults = [];
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("request", (request) => {
    const to = new URL(request.url());
    if (to.origin !== origin && !["blob:", "data:"].includes(to.protocol)) faults.push(`a request to ${to.origin}`);
  });
  page.faults = faults;
  await page.goto(address);
  return page;
}

/** Checks what holds on every page, and keeps a picture of it. */
export async function check(page, name) {
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
  const told = serious.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).slice(0, 3).join(" ")}`);
  assert.deepEqual(told, [], `axe-core on ${name}`);
  const beyond = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  assert.ok(beyond <= 0, `${name} is ${beyond} px wider than the screen`);
  mkdirSync(OUTPUT, { recursive: true });
  await page.screenshot({ path: `${OUTPUT}${name}.png` });
  // They are made anew by `npm run pictures`.
  if (process.env.WAYMARK_PICTURES && PICTURES.has(name)) await picture(page, `${GUIDE}${name}.webp`);
  assert.deepEqual(page.faults, [], `faults of ${name}`);
}

/** Keeps a small picture of what is in sight. */
async function picture(page, file) {
  mkdirSync(GUIDE, { recursive: true });
  const cdp = await page.context().newCDPSession(page);
  for (let quality = 80; quality > 0; quality -= 15) {
    const { data } = await cdp.send("Page.captureScreenshot", { format: "webp", quality });
    const bytes = Buffer.from(data, "base64");
    if (bytes.length > MOST_BYTES) continue;
    writeFileSync(file, bytes);
    return;
  }
  assert.fail(`${file} has more than ${MOST_BYTES} bytes`);
}
