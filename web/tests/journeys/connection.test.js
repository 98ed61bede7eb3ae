// Journeys while the server goes away and comes back: every page says since when there is no connection, shows nothing old as
// if it were of now, and is live again without being loaded anew. Sessions that end lead to the page to sign in.
import assert from "node:assert/strict";
import { test } from "node:test";
import { check, guestOf, hall, journeys, open, plain } from "./harness.js";

/** What docs/guides/administrator.md promises, ms. */
const SAID_MS = 5000;
const LIVE_MS = 10_000;
const LOST = /No connection to the server since \d/;

const world = journeys({
  begin: async () => {
    await hall(world);
    await api("PUT", "/robots/mower", { map: "hall" });
  },
});
const { api, go } = world;
/** The same server once more, at the same address. */
const again = async () => {
  const { port } = new URL(world.origin);
  world.server = await plain(world.folder, "--http", `127.0.0.1:${port}`);
};
/** What a browser reports of a server that is away. */
const AWAY = /ERR_CONNECTION|ERR_EMPTY_RESPONSE|ERR_INCOMPLETE|ERR_SOCKET|Failed to load resource/;

/** Pages with what shows that they are live: a change by somebody else, and the words that then stand there. */
const LANDMARK = (name) => [() => api("POST", "/maps/hall/landmarks", { name }), name];
const PAGES = [
  ["/maps/hall", LANDMARK("after-map")],
  ["/maps/hall/landmarks", LANDMARK("after-list")],
  ["/maps/hall/history", [() => api("POST", "/maps/hall/landmarks", { name: "after-history" }), /after-history/]],
  ["/admin?part=events", [() => api("POST", "/maps/hall/landmarks", { name: "after-events" }), /The landmark after-events of hall was added/]],
  ["/", [() => api("POST", "/maps", { name: "after-maps" }), "after-maps"]],
  ["/robots", [() => api("PUT", "/robots/after", { map: "hall" }), "after"]],
  ["/robots/mower", [() => api("PUT", "/robots/mower", { map: "yard" }), "yard"]],
  ["/admin", undefined],
  ["/answers", undefined],
  ["/maps/hall/landmarks/poster", undefined],
  ["/maps/hall/teach", undefined],
  ["/maps/hall/gather", undefined],
  ["/maps/hall/settings", undefined],
];
/** Pages at a time: a browser has six connections to a server, and pages hold streams. */
const AT_ONCE = 4;

test("a server that is killed and started again: every page says so, and is live again without being loaded anew", async () => {
  await api("POST", "/maps", { name: "yard" });
  for (let i = 0; i < PAGES.length; i += AT_ONCE) {
    const some = PAGES.slice(i, i + AT_ONCE);
    const pages = await Promise.all(some.map(([address]) => go(address)));
    for (const page of pages) {
      await page.getByRole("heading", { level: 1 }).waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await page.evaluate(() => (globalThis.is_the_same_page = true));
    }
    await world.server.kill();
    const killed = Date.now();
    await Promise.all(pages.map((page, j) => page.getByText(LOST).waitFor({ timeout: SAID_MS }).catch(() => assert.fail(`${some[j][0]} has not said within ${SAID_MS} ms that there is no connection`))));
    assert.ok(Date.now() - killed < SAID_MS + 1000);
    for (const [j, page] of pages.entries()) assert.equal(await page.locator("main.old").count(), 1, `${some[j][0]}: what is shown is grey`);
    await again();
    await Promise.all(pages.map((page, j) => page.getByText(LOST).waitFor({ state: "detached", timeout: LIVE_MS }).catch(() => assert.fail(`${some[j][0]} is not back within ${LIVE_MS} ms`))));
    for (const [j, page] of pages.entries()) {
      const [address, live] = some[j];
      assert.equal(await page.getByRole("heading", { name: "Sign in to Waymark" }).count(), 0, `${address}: the session goes on`);
      assert.equal(await page.locator("main.old").count(), 0, `${address}: what is shown is of now`);
      if (live) {
        const [change, words] = live;
        await change();
        await page.locator("main").getByText(words, { exact: typeof words === "string" }).first().waitFor({ timeout: LIVE_MS }).catch(() => assert.fail(`${address} does not show ${words}`));
      }
      assert.ok(await page.evaluate(() => globalThis.is_the_same_page), `${address} was loaded anew`);
      assert.deepEqual(page.faults.filter((fault) => !AWAY.test(fault)), [], address);
      await page.close();
    }
  }
});

test("what was typed stays while the server is away, and is saved when it is back", async () => {
  const page = await go("/maps/hall/landmarks/poster");
  await page.getByRole("button", { name: "Size", exact: true }).click();
  await page.getByLabel("Width, metres").fill("0.77");
  await world.server.kill();
  await page.getByText(LOST).waitFor({ timeout: SAID_MS });
  await check(Object.assign(page, { faults: [] }), "connection-lost");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByRole("dialog").getByText("The server cannot be reached.").waitFor();
  await again();
  await page.getByText(LOST).waitFor({ state: "detached", timeout: LIVE_MS });
  assert.equal(await page.getByLabel("Width, metres").inputValue(), "0.77");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText("The size is changed.").waitFor();
  assert.equal((await api("GET", "/maps/hall/landmarks/poster")).size.width_m, 0.77);
});

test("a health that is not known any more is not shown as good", async () => {
  const page = await go("/admin");
  const ready = page.getByText("Ready", { exact: true });
  await ready.waitFor();
  const colour = () => ready.evaluate((state) => getComputedStyle(state).color);
  const faint = await page.evaluate(() => {
    const probe = Object.assign(document.createElement("p"), { className: "hint" });
    document.body.append(probe);
    return getComputedStyle(probe).color;
  });
  assert.notEqual(await colour(), faint, "green while it is known");
  await world.server.kill();
  await page.getByText(LOST).waitFor({ timeout: SAID_MS });
  assert.equal(await colour(), faint, "grey while it is not");
  await again();
  await page.getByText(LOST).waitFor({ state: "detached", timeout: LIVE_MS });
  assert.notEqual(await colour(), faint);
});

test("a page whose session ends elsewhere leads to the page to sign in", async () => {
  const { text } = await api("POST", "/tokens", { name: "looker", role: "viewer" });
  const guest = await guestOf(world);
  const page = await open(guest, world.origin, "/maps/hall");
  await page.getByLabel("Token").fill(text);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByText("· live").waitFor();
  await guest.request.post(`${world.origin}/logout`, { headers: { "x-waymark-page": "1" } });
  await page.getByRole("heading", { name: "Sign in to Waymark" }).waitFor({ timeout: LIVE_MS });
  await guest.close();
});

test("a stream that is refused for a while is opened again", async () => {
  const page = await go("about:blank");
  let refused = 0;
  const full = { type: "about:blank", title: "Service Unavailable", status: 503, code: "too_many_streams", detail: "all event streams are in use" };
  await page.route("**/api/v1/maps/hall/live", (route) => (refused++ < 2 ? route.fulfill({ status: 503, contentType: "application/problem+json", body: JSON.stringify(full) }) : route.continue()));
  await page.goto(`${world.origin}/maps/hall`);
  await page.getByText("· live").waitFor({ timeout: LIVE_MS });
  assert.ok(refused >= 2, `${refused} times refused`);
  assert.equal(await page.getByText(LOST).count(), 0, "the server is there");
});
