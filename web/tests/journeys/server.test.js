// Journeys to how the server is: healthy, without room, without its router, not ready; several servers; what has happened.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, test } from "node:test";
import { PHONE, check, eventually, hall, journeys, open, serve, signedIn } from "./harness.js";

/** What ends the further servers: before the folder is removed. */
const others = [];
after(async () => {
  for (const end of others.reverse()) await end();
});
const world = journeys({ begin: async () => void (await hall(world)) });
const { api, go } = world;
/** A further server with a folder of its own, and a browser that is signed in. */
async function another(name, ...args) {
  const server = await serve("--data", join(world.folder, name), ...(args.includes("--router") ? [] : ["--zenoh", "tcp/127.0.0.1:0"]), ...args);
  others.push(server.stop);
  const its = await signedIn(server);
  others.push(its.close);
  return { api: its.ask, go: (address, size) => open(its.context, its.origin, address, size) };
}
const health = (page) => page.locator("section.card").filter({ has: page.locator("#health-title") });

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`a healthy server says that nothing is wrong, and how full its disk is, at the ${where}`, async () => {
    const page = await go("/admin", size);
    await health(page).getByText("Ready", { exact: true }).waitFor();
    await page.getByText(/Nothing is wrong/).waitFor();
    const { storage } = await api("GET", "/readyz");
    await page.getByText(new RegExp(`^\\s*${storage.used_percent} % of .* used, .* free.*From ${storage.limit_percent} % on, learning and uploads are refused`)).waitFor();
    await page.getByText("Stand-alone server.").waitFor();
    await page.getByRole("row").filter({ hasText: "(this one)" }).getByRole("link", { name: "hall" }).waitFor();
    await check(page, `health-${where}`);
  });

  test(`a server that is not ready says which part, and what to do, at the ${where}`, async () => {
    const page = await go("about:blank", size);
    // A part that stands still cannot be had of a server that is to answer: its answer is given here.
    const problem = { type: "/problems/part_stalled", title: "Service Unavailable", status: 503, code: "part_stalled", detail: "the writer of the store has not gone on for 7 s; after 15 s the server ends with an error", part: "the writer of the store" };
    await page.route("**/api/v1/readyz", (route) => route.fulfill({ status: 503, contentType: "application/problem+json", body: JSON.stringify(problem) }));
    await page.goto(`${world.origin}/admin`);
    await health(page).getByText("Not ready", { exact: true }).waitFor();
    const fault = page.getByRole("list", { name: "What is wrong" }).getByRole("listitem");
    assert.equal(await fault.count(), 1);
    assert.match(await fault.textContent(), /The writer of the store has not gone on for 7 s; .* Wait a few seconds/);
    page.faults.splice(0, page.faults.length, ...page.faults.filter((text) => !/503/.test(text)));
    await check(page, `health-not-ready-${where}`);
  });
}

test("a disk without room is told with an advice, and learning is refused", async () => {
  const settings = join(world.folder, "full.toml");
  writeFileSync(settings, "[limits]\ndisk_percent = 1\ndisk_spare_bytes = 1000000000000000\n");
  const { go, api } = await another("full", "--config", settings);
  const page = await go("/admin");
  await health(page).getByText("Degraded", { exact: true }).waitFor();
  const fault = page.getByRole("list", { name: "What is wrong" }).getByRole("listitem");
  assert.equal(await fault.count(), 1);
  assert.match(await fault.textContent(), /The disk of the data directory is \d+ % full \(limit 1 %\).*nothing is added until there is room\.\s+Delete backups, maps or gatherings/);
  await page.getByText("Learning and uploads are refused.").waitFor();
  await assert.rejects(api("POST", "/maps", { name: "hall" }), /507.*storage_nearly_full/);
  await check(page, "health-disk");
});

test("a server without its router says so, and two servers of one router are listed with their maps", async () => {
  // A server that joins no router is one itself.
  const router = world.server.robots;
  const first = await another("first", "--server-name", "hall-server", "--router", router);
  await first.api("POST", "/maps", { name: "east" });
  const second = await another("second", "--server-name", "annex-server", "--router", router);
  await second.api("POST", "/maps", { name: "west" });
  await eventually("second server in the list of the first", async () => (await first.api("GET", "/servers")).servers.length > 1);
  const page = await first.go("/admin");
  const row = (name) => page.getByRole("row").filter({ hasText: name });
  await row("hall-server").filter({ hasText: "(this one)" }).getByRole("link", { name: "east" }).waitFor();
  await row("annex-server").getByText("west").waitFor();
  await check(page, "health-servers");
  const lost = await another("lost", "--server-name", "lost-server", "--router", "tcp/127.0.0.1:9");
  const alone = await lost.go("/admin");
  await health(alone).getByText("Degraded", { exact: true }).waitFor();
  await alone.getByText(/This server has no part in its router: no connection to tcp\/127\.0\.0\.1:9/).waitFor();
  await alone.getByText("Look whether the router runs").waitFor();
  await check(alone, "health-no-router");
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`events of before and of now stand in a table, the newest first, at the ${where}`, async () => {
    const page = await go("/admin?part=events", size);
    const rows = page.locator("tbody tr");
    const before = page.getByText("The landmark poster of hall was added.");
    await before.waitFor();
    await page.getByText("Live: new events appear by themselves.").waitFor();
    const name = `event-${where}`;
    await api("POST", "/maps", { name });
    const now = page.getByText(`The map ${name} has version`).first();
    await now.waitFor();
    const texts = await rows.allTextContents();
    const at = (text) => texts.findIndex((row) => row.includes(text));
    assert.ok(at(`The map ${name}`) >= 0 && at(`The map ${name}`) < at("The landmark poster of hall was added."), texts.join("\n"));
    // Cut off for a while, it goes on where it was.
    await world.context.setOffline(true);
    await world.context.setOffline(false);
    await api("POST", `/maps/${name}/landmarks`, { name: "door" });
    await page.getByText(`The landmark door of ${name} was added.`).waitFor();
    assert.equal(await page.getByText(`The landmark door of ${name} was added.`).count(), 1);
    await page.getByLabel("What about").selectOption("landmark_changed");
    await now.waitFor({ state: "detached" });
    await page.waitForURL(/kind=landmark_changed/);
    await before.waitFor();
    page.faults.splice(0, page.faults.length, ...page.faults.filter((text) => !/ERR_INTERNET_DISCONNECTED/.test(text)));
    await check(page, `events-${where}`);
  });
}
