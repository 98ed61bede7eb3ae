// Journeys of administration that need no driving robot: photographs that were refused, deleting and undo, tokens, and what
// pages say when they are empty or broken, of long names, by keyboard, to a viewer.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, check, eventually, guestOf, hall, journeys, learnt, open, uploaded } from "./harness.js";

const world = journeys({
  begin: async () => {
    world.photograph = await hall(world);
    await api("PUT", "/robots/mower", { map: MAP });
  },
});
const { api, go } = world;
const MAP = "hall";
const landmarksOf = async () => (await api("GET", `/maps/${MAP}/landmarks`)).items;

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`photographs that were refused are shown with the reason, at the ${where}`, async () => {
    const upload = (buffer, parts) => uploaded(world.context, world.origin, "poster", buffer, parts);
    const page = await go("/maps/hall/landmarks/poster", size);
    const refused = page.getByRole("region", { name: "Photographs that were refused" });
    if (where === "desk") await refused.getByText("None: every photograph was taken").waitFor();
    assert.equal((await upload(world.photograph.subarray(0, world.photograph.length / 2), { whole_image: "true" })).status(), 422);
    const blank = Buffer.from(
      await page.evaluate(() => {
        const canvas = Object.assign(document.createElement("canvas"), { width: 320, height: 200 });
        canvas.getContext("2d").fillRect(0, 0, 320, 200);
        return canvas.toDataURL("image/png").split(",")[1];
      }),
      "base64",
    );
    assert.equal((await upload(blank)).status(), 422);
    assert.equal((await upload(world.photograph, { whole_image: "true" })).status(), 200);
    await page.reload();
    await refused.getByText("It is photograph 1 once more. Choose another photograph.").first().waitFor();
    await refused.getByText("No four edges were found in it.").first().waitFor();
    await refused.getByText(/The file is damaged/).first().waitFor();
    const pictures = refused.getByRole("img", { name: "What was refused" });
    await pictures.first().scrollIntoViewIfNeeded();
    await page.waitForFunction(() => [...document.querySelectorAll("img[alt='What was refused']")].slice(0, 2).every((image) => image.naturalWidth > 20));
    await check(page, `refused-${where}`);
  });
}

test("a landmark is deleted and brought back by the history", async () => {
  const name = "poster";
  const page = await go(`/maps/${MAP}/landmarks/${name}`);
  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await page.getByRole("button", { name: "Delete the landmark" }).click();
  await page.waitForURL(/history/);
  assert.ok(!(await landmarksOf()).some((one) => one.name === name));
  await page.getByRole("button", { name: /Undo change/ }).first().click();
  await page.getByRole("button", { name: "Undo it" }).click();
  await eventually("landmark again", async () => (await landmarksOf()).some((one) => one.name === name && one.status === "active"));
  // Pictures that are still on their way when it is deleted are not there any more.
  assert.deepEqual(page.faults.filter((fault) => !/404/.test(fault)), []);
});

test("every edit of a landmark is undone from its message", async () => {
  const page = await go(`/maps/${MAP}/landmarks/poster`);
  const poster = () => api("GET", `/maps/${MAP}/landmarks/poster`);
  const before = await poster();
  const undone = async (what) => {
    await page.getByRole("status").filter({ hasText: what }).getByRole("button", { name: "Undo" }).click();
    await page.getByRole("status").filter({ hasText: what }).waitFor({ state: "detached" });
  };
  await page.getByRole("button", { name: "Place by numbers" }).click();
  await page.getByRole("dialog").getByLabel("Its centre above the floor, m").fill("1.75");
  await page.getByRole("dialog").getByLabel("Direction that it faces, degrees").fill("-80");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText("centre 1.75 m above the floor, faces 280°").waitFor();
  assert.equal((await poster()).place.z_m, 1.75);
  await undone("The place is changed.");
  await page.getByText("centre 1.40 m above the floor").waitFor();
  await page.getByRole("button", { name: "Size", exact: true }).click();
  await page.getByLabel("Width, metres").fill("0.7");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await undone("The size is changed.");
  await page.getByText("0.60 m wide").waitFor();
  await page.getByRole("button", { name: "Rename" }).click();
  await page.getByRole("dialog").getByLabel("Name").fill("banner");
  await page.getByRole("dialog").getByRole("button", { name: "Rename" }).click();
  await page.getByRole("heading", { name: "banner", level: 1 }).waitFor();
  await undone("poster is called banner now.");
  await page.getByRole("heading", { name: "poster", level: 1 }).waitFor();
  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await page.getByRole("button", { name: "Delete the landmark" }).click();
  await page.waitForURL(/history/);
  await undone("poster is deleted.");
  await page.getByRole("heading", { name: "poster", level: 1 }).waitFor();
  const { size, place, views } = await poster();
  assert.deepEqual([size, place, views], [before.size, before.place, before.views]);
  // The page of a name that is taken back may be read once more before it is left.
  assert.deepEqual(page.faults.filter((fault) => !/404/.test(fault)), []);
});

test("a deleted map is brought back by undo, with its landmarks", async () => {
  await api("POST", "/maps", { name: "shed" });
  await api("POST", "/maps/shed/landmarks", { name: "door" });
  await api("PUT", "/robots/barrow", { map: "shed" });
  const page = await go("/");
  await page.getByRole("button", { name: "Delete shed" }).click();
  await page.getByRole("dialog").getByRole("textbox").fill("shed");
  // A robot on it keeps it.
  await page.getByRole("dialog").getByText("1 robot stands on it: barrow. Move it to another map first.").waitFor();
  await page.getByRole("button", { name: "Delete the map" }).click();
  await page.getByRole("dialog").getByRole("alert").waitFor();
  await api("DELETE", "/robots/barrow");
  await page.getByRole("button", { name: "Delete the map" }).click();
  await page.getByRole("link", { name: "shed", exact: true }).waitFor({ state: "detached" });
  assert.ok(!(await api("GET", "/maps")).items.some(({ name }) => name === "shed"));
  await page.getByRole("status").filter({ hasText: "The map shed is deleted." }).getByRole("button", { name: "Undo" }).click();
  await page.getByRole("link", { name: "shed", exact: true }).waitFor();
  await page.getByText("The map shed is back.").waitFor();
  assert.deepEqual((await api("GET", "/maps/shed/landmarks")).items.map(({ name }) => name), ["door"]);
  // The first answer is a refusal, which the browser reports.
  assert.deepEqual(page.faults.filter((fault) => !/409/.test(fault)), []);
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`landmarks that look alike stand side by side, at the ${where}`, async () => {
    if (where === "desk") {
      assert.equal((await uploaded(world.context, world.origin, "twin", world.photograph, { whole_image: "true", create: "true" })).status(), 201);
      await learnt(api, "twin");
    }
    const page = await go(`/maps/${MAP}/landmarks`, size);
    const pair = page.locator(".pair");
    const pictures = ["What was learnt of poster", "Photograph of twin"].map((name) => pair.getByRole("img", { name }));
    for (const picture of pictures) await picture.waitFor();
    // While the list is drawn anew, there is none.
    const [a, b] = await eventually("two pictures", async () => {
      const boxes = await Promise.all(pictures.map((picture) => picture.boundingBox()));
      return boxes.every(Boolean) && boxes;
    });
    assert.ok(Math.abs(a.y - b.y) < 2 && Math.abs(a.x - b.x) >= a.width, "they stand side by side");
    await pair.getByText(/^\d+ % alike/).waitFor();
    await page.getByText(/looks like/i).first().waitFor();
    await check(page, `look-alikes-${where}`);
  });
}

test("a token is made for a person, used, and revoked", async () => {
  const page = await go("/admin?part=tokens");
  await page.getByRole("button", { name: "Users and tokens" }).click();
  await page.getByRole("button", { name: "New token" }).click();
  await page.getByLabel("Name, of a person or a program").fill("anna");
  await page.getByLabel("Role").selectOption("teacher");
  await page.getByRole("dialog").getByLabel(MAP, { exact: true }).check();
  await page.getByRole("button", { name: "Create" }).click();
  const text = (await page.getByRole("status").locator("code").textContent()).trim();
  const anna = await guestOf(world);
  const hers = await open(anna, world.origin, "/");
  await hers.getByLabel("Token").fill(text);
  await hers.getByRole("button", { name: "Sign in" }).click();
  await hers.getByText("anna · teacher").waitFor();
  await hers.getByRole("link", { name: "Administration" }).click();
  await hers.getByRole("button", { name: "Jobs" }).waitFor();
  assert.equal(await hers.getByRole("button", { name: "Users and tokens" }).count(), 0, "a teacher sees no tokens");
  await page.getByRole("button", { name: "Revoke anna" }).click();
  await page.getByRole("button", { name: "Revoke it" }).click();
  await page.getByRole("row", { name: /anna/ }).getByText("revoked").waitFor();
  await hers.reload();
  await hers.getByRole("heading", { name: "Sign in to Waymark" }).waitFor();
  assert.deepEqual(page.faults, []);
  await anna.close();
});

/** The longest name. */
const LONG = `a${"-very-long-name".repeat(4)}`.slice(0, 64);

test("empty pages say so, and have the button that helps", async () => {
  await api("POST", "/maps", { name: LONG, site: "A site with a long name of its own", building: "House of many floors and doors" });
  for (const [address, words, button] of [
    [`/maps/${LONG}`, /There is no landmark on this map yet/, /Teach the first one/],
    [`/maps/${LONG}/landmarks`, /no landmark/i, /Teach|Photograph|photograph/],
    [`/maps/${LONG}/gather`, /collect/i, /Begin to collect/],
    [`/answers?map=${LONG}`, /No results match these filters/, undefined],
  ]) {
    const page = await go(address, PHONE);
    await page.getByText(words).first().waitFor();
    if (button) await page.getByRole("button", { name: button }).or(page.getByRole("link", { name: button })).first().waitFor();
    await check(page, `empty-${address.replaceAll(/[^a-z]+/g, "-").replace(LONG.replaceAll(/[^a-z]+/g, "-"), "map")}`);
    await page.close();
  }
});

test("long names fit on a phone", async () => {
  const name = `b${"-long-landmark".repeat(5)}`.slice(0, 64);
  await api("POST", `/maps/${LONG}/landmarks`, { name });
  for (const [address, what] of [["", "map"], ["/landmarks", "landmarks"], [`/landmarks/${name}`, "landmark"], ["/history", "history"], ["/settings", "settings"], ["/teach", "teach"]]) {
    const page = await go(`/maps/${LONG}${address}`, PHONE);
    await page.getByRole("heading", { level: 1 }).waitFor();
    await page.waitForFunction(() => !document.querySelector(".loading"));
    await check(page, `long-${what}`);
    await page.close();
  }
});

test("pages of what is not there say so, and those of a server that is gone offer to try again", async () => {
  for (const address of ["/maps/nosuch", "/maps/nosuch/landmarks", `/maps/${MAP}/landmarks/nosuch`, "/robots/nosuch", "/answers/99999999", "/maps/nosuch/history"]) {
    const page = await go(address);
    await page.getByText(/has failed|no map|no landmark|no robot|no stored answer|There is no/i).first().waitFor();
    // A refusal of the server is what the page is about; the browser reports its status.
    assert.deepEqual(page.faults.filter((fault) => !/404/.test(fault)), [], address);
    await page.close();
  }
  const page = await go("/");
  await page.getByRole("link", { name: MAP, exact: true }).waitFor();
  await page.route("**/api/v1/answers**", (route) => route.abort());
  await page.getByRole("link", { name: "Recognition log" }).click();
  await page.getByRole("alert").first().waitFor();
  const again = page.getByRole("button", { name: /again/i }).first();
  await again.waitFor();
  await page.unroute("**/api/v1/answers**");
  // The page asks again by itself, too: then the button may be gone.
  await again.click({ timeout: 5_000 }).catch((error) => assert.match(String(error), /Timeout/));
  await page.getByText("No results match these filters").waitFor();
});

test("landmarks of a map are reached by the keyboard alone", async () => {
  const page = await go(`/maps/${MAP}`);
  const list = page.getByRole("region", { name: "Landmarks", exact: true });
  const [first] = await landmarksOf();
  await list.getByRole("button", { name: first.name }).waitFor();
  await page.locator("body").press("Tab");
  let steps = 0;
  const focused = () => page.evaluate(() => document.activeElement?.textContent?.trim() ?? "");
  while ((await focused()) !== first.name && steps++ < 80) await page.keyboard.press("Tab");
  assert.equal(await focused(), first.name, `within ${steps} steps`);
  await page.keyboard.press("Enter");
  await page.getByRole("region", { name: "Chosen landmark" }).waitFor();
  assert.deepEqual(page.faults, []);
});

test("a viewer sees no button that changes anything, on any page", async () => {
  const [robot, landmark] = ["mower", "poster"];
  const { text } = await api("POST", "/tokens", { name: "looker", role: "viewer" });
  const guest = await guestOf(world);
  const page = await open(guest, world.origin, "/");
  await page.getByLabel("Token").fill(text);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("link", { name: MAP, exact: true }).waitFor();
  const changes = /new|delete|remove|rename|copy|save|learn|begin|publish|undo|go back|admit|revoke|calibrate|record|merge|size|take out|move|upload|accept|throw|set robot position|floor plan|add /i;
  for (const address of ["/", `/maps/${MAP}`, `/maps/${MAP}/landmarks`, `/maps/${MAP}/landmarks/${landmark}`, `/maps/${MAP}/history`, `/maps/${MAP}/settings`, "/robots", `/robots/${robot}`, "/answers"]) {
    await page.goto(address);
    await page.getByRole("heading", { level: 1 }).first().waitFor();
    await page.waitForFunction(() => !document.querySelector(".loading"));
    const buttons = await page.getByRole("button").evaluateAll((all) => all.filter((one) => !one.disabled).map((one) => one.getAttribute("aria-label") ?? one.textContent.trim()));
    assert.deepEqual(buttons.filter((name) => changes.test(name) && !name.startsWith("Copy: ")), [], address);
  }
  await guest.close();
});
