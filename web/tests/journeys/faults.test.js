// Journeys that check what a person reads and gets where pages once did nothing, or said what was not so.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { PHONE, check, guestOf, hall, journeys, layPlan, open, roomPlan } from "./harness.js";

const world = journeys({
  begin: async () => {
    world.photograph = await hall(world);
    await api("PUT", "/robots/mower", { map: "hall" });
  },
});
const { api, go } = world;
const poster = () => api("GET", "/maps/hall/landmarks/poster");

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`each part of the server shows what it is about when it is clicked, at the ${where}`, async () => {
    const page = await go("/admin", size);
    const main = page.locator("main");
    const parts = [
      ["Events", main.getByLabel("What about")],
      ["Jobs", main.getByRole("columnheader", { name: "Asked for" })],
      ["Users and tokens", main.getByRole("button", { name: "New token" })],
      ["Audit log", main.getByRole("button", { name: "Check the log" })],
      ["Backups", main.getByRole("button", { name: "Back up now" })],
      ["Health", main.getByText("Ready", { exact: true })],
    ];
    for (const [name, content] of parts) {
      await page.getByRole("button", { name, exact: true }).click();
      await content.waitFor({ timeout: 10_000 });
      for (const [other, hidden] of parts) if (other !== name) assert.equal(await hidden.count(), 0, `${name} shows ${other}`);
    }
    for (const [name, words] of [["Where it lies|Position in the building", /It lies in the map/], ["Which camera looks|Camera assumed for coverage", /Camera above the floor, m/], ["Walls from scans", /A robot with a laser is driven round once/]]) {
      await page.goto(`${world.origin}/maps/hall/settings`);
      await page.getByRole("button", { name: new RegExp(name) }).click();
      await page.getByText(words).first().waitFor({ timeout: 10_000 });
    }
  });
}

test("a token for a viewer is made by clicks alone, from the first page on", async () => {
  const page = await go("/");
  let clicks = 0;
  const click = async (locator) => {
    clicks += 1;
    await locator.click({ timeout: 10_000 });
  };
  await click(page.getByRole("link", { name: /^(Server|Administration)$/ }));
  await click(page.getByRole("button", { name: "Users and tokens" }));
  await click(page.getByRole("button", { name: "New token" }));
  await page.getByLabel("Name, of a person or a program").fill("by-clicks");
  await click(page.getByRole("button", { name: /^(Make it|Create)$/ }));
  await page.getByRole("status").locator("code").waitFor();
  assert.ok(clicks <= 4, `${clicks} clicks`);
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`a landmark on a floor plan without walls is asked where it looks and how high it hangs, at the ${where}`, async () => {
    const map = `plan-${where}`;
    await api("POST", "/maps", { name: map });
    await api("POST", `/maps/${map}/landmarks`, { name: "sign", size: { width_m: 0.6, height_m: 0.8 } });
    const page = await go(`/maps/${map}?landmark=sign&view=10,6,0.05,0`, size);
    await layPlan(world, map, await roomPlan(world));
    await page.reload();
    await page.getByRole("button", { name: "Place on the map" }).click();
    const floor = page.getByRole("application");
    /** Where on the screen a point is, px from the middle of the map. */
    const at = async (dx, dy) => {
      await floor.evaluate((element) => element.scrollIntoView({ block: "center" }));
      const box = await floor.boundingBox();
      return [box.x + box.width / 2 + dx, box.y + box.height / 2 + dy];
    };
    const sign = () => api("GET", `/maps/${map}/landmarks/sign`);
    await page.mouse.click(...(await at(0, -80)));
    await page.getByText(/no wall near, so the direction is not known/).waitFor({ timeout: 10_000 });
    assert.equal((await sign()).place ?? null, null, "nothing is stored without a direction");
    assert.ok(await page.getByRole("button", { name: "Save the place" }).isDisabled());
    await page.mouse.click(...(await at(0, 0)));
    assert.equal(await page.getByLabel("Faces, degrees").inputValue(), "270");
    await page.getByLabel("Centre above the floor, m").fill("1.8");
    // The handle turns it: from straight down to the right.
    await page.mouse.move(...(await at(0, -10)));
    await page.mouse.down();
    await page.mouse.move(...(await at(80, -80)), { steps: 6 });
    await page.mouse.up();
    assert.equal(await page.getByLabel("Faces, degrees").inputValue(), "0");
    await page.getByLabel("Faces, degrees").fill("265");
    await page.getByLabel("Faces, degrees").press("Tab");
    await check(page, `placing-${where}`);
    await page.getByRole("button", { name: "Save the place" }).click();
    await page.getByText(/sign is placed at 10\.\d\d m, 10\.\d\d m, 1\.80 m above the floor, and faces 265°/).waitFor();
    const { place } = await sign();
    assert.ok(Math.abs(place.theta_rad + (95 * Math.PI) / 180) < 1e-3 || Math.abs(place.theta_rad - (265 * Math.PI) / 180) < 1e-3, JSON.stringify(place));
    assert.equal(place.z_m, 1.8);
  });
}

test("of two tabs that change one landmark the second is told, and its input is kept", async () => {
  const [first, second] = [await go("/maps/hall/landmarks/poster"), await go("/maps/hall/landmarks/poster")];
  for (const page of [first, second]) await page.getByRole("button", { name: "Size", exact: true }).click();
  await first.getByLabel("Height, metres").fill("2.5");
  await first.getByRole("button", { name: "Save", exact: true }).click();
  await first.getByText("The size is changed.").waitFor();
  // The second page reads the change under its open dialog.
  await second.locator("main").getByText("2.50 m high").first().waitFor();
  await second.getByLabel("Width, metres").fill("1.7");
  await second.getByRole("button", { name: "Save", exact: true }).click();
  await second.getByRole("dialog").getByText(/Somebody has changed poster meanwhile\. It is now 0\.60 m wide, 2\.50 m high/).waitFor({ timeout: 10_000 });
  assert.equal(await second.getByLabel("Width, metres").inputValue(), "1.7", "what was typed is kept");
  assert.deepEqual((await poster()).size, { width_m: 0.6, height_m: 2.5 }, "nothing is lost unseen");
  await second.getByLabel("Height, metres").fill("2.5");
  await second.getByRole("button", { name: "Save", exact: true }).click();
  await second.getByText("The size is changed.").waitFor();
  assert.deepEqual((await poster()).size, { width_m: 1.7, height_m: 2.5 });
});

test("of two tabs that trace walls the second is told, and its walls are kept", async () => {
  await api("POST", "/maps", { name: "shared" });
  const [first, second] = [await go("/maps/shared?view=0,0,0.02,0"), await go("/maps/shared?view=0,0,0.02,0")];
  for (const [page, dy] of [[first, 100], [second, -100]]) {
    await page.getByRole("button", { name: "Trace walls" }).click();
    await page.getByText("Click where a wall begins.").waitFor();
    const box = await page.getByRole("application").boundingBox();
    await page.mouse.click(box.x + box.width / 2 - 100, box.y + box.height / 2 + dy);
    await page.mouse.click(box.x + box.width / 2 + 100, box.y + box.height / 2 + dy);
  }
  await first.getByRole("button", { name: "Save the walls" }).click();
  await first.getByText("The walls are saved: 1 drawn or moved").waitFor();
  await second.getByRole("button", { name: "Save the walls" }).click();
  await second.getByText(/Somebody has changed the walls meanwhile\. Yours are kept/).waitFor();
  assert.equal((await api("GET", "/maps/shared/walls")).segments.length, 1);
  await second.getByRole("button", { name: "Save the walls" }).waitFor();
});

test("a landmark that was deleted in another tab is not shown as in use", async () => {
  await api("POST", "/maps/hall/landmarks", { name: "passing" });
  const page = await go("/maps/hall/landmarks/passing");
  await page.getByRole("heading", { name: /passing/, level: 1 }).waitFor();
  await api("DELETE", "/maps/hall/landmarks/passing", undefined, { "if-match": "*" });
  await page.getByText("There is nothing to show of the landmark").waitFor({ timeout: 10_000 });
  for (const name of ["Rename", "Size", "Delete", "Take out of use"]) assert.equal(await page.getByRole("button", { name, exact: true }).count(), 0, name);
});

test("a landmark that is taken out of use says that a person did it, and is put back by undo", async () => {
  const page = await go("/maps/hall/landmarks/poster");
  await page.getByRole("button", { name: "Take out of use" }).click();
  const told = page.getByRole("status").filter({ hasText: "Robots no longer use poster." });
  await told.waitFor({ timeout: 10_000 });
  await page.locator("main").getByText(/Somebody took it out of use/).waitFor();
  assert.equal(await page.getByText(/It has moved or changed/).count(), 0);
  await page.getByRole("button", { name: "Put back in use" }).waitFor();
  await told.getByRole("button", { name: "Undo" }).click();
  await page.getByRole("button", { name: "Take out of use" }).waitFor();
  assert.equal((await poster()).health, "sound");
});

test("a photograph of 60 MB is made smaller, and what is no picture is refused before anything is typed", async () => {
  const large = join(world.folder, "large.png");
  writeFileSync(large, Buffer.concat([world.photograph, Buffer.alloc(60e6)]));
  const page = await go("/maps/hall/teach");
  await page.locator("input[type=file]").first().setInputFiles(large);
  await page.getByText(/The file has 60\.0 MB, more than the server takes\. It is sent smaller: 300 × 300 pixels/).waitFor({ timeout: 20_000 });
  await page.getByRole("button", { name: "Set the corners myself" }).click();
  await page.getByLabel("Name", { exact: true }).fill("from-large");
  await page.getByRole("button", { name: "Add the photograph" }).click();
  await page.getByText(/Added to from-large/).waitFor();
  const text = { name: "notes.png", mimeType: "image/png", buffer: Buffer.from("no picture") };
  await page.locator("input[type=file]").first().setInputFiles(text);
  await page.getByText("This file is not a readable image. Use JPEG or PNG.").waitFor();
  assert.equal(await page.getByText(/Nothing with four corners was found/).count(), 0, "it was not looked at");
  await page.goto(`${world.origin}/maps/hall`);
  await page.getByRole("button", { name: "Floor plan" }).click();
  await page.getByLabel("Picture (PNG or JPEG)").setInputFiles(text);
  await page.getByText("This file is not a readable image. Use JPEG or PNG.").waitFor();
  assert.equal(await page.getByRole("img", { name: "The floor plan" }).count(), 0, "no broken picture");
  await page.getByLabel("Picture (PNG or JPEG)").setInputFiles(large);
  await page.getByText("This picture has 60.0 MB; 16 MB is the most.").waitFor();
});

test("addresses that are none say so in words, without navigation of what is not there", async () => {
  for (const address of ["/maps", "/wiki", "/tokens", "/map/x", "/maps/%E0%A4%A"]) {
    const page = await go(address);
    await page.getByRole("heading", { name: "There is no such page" }).waitFor({ timeout: 10_000 });
    await page.getByRole("link", { name: "All maps" }).click();
    await page.getByRole("link", { name: "hall", exact: true }).waitFor();
    await page.close();
  }
  for (const address of ["", "/landmarks", "/teach", "/settings", "/history"]) {
    const page = await go(`/maps/nosuch${address}`);
    await page.getByRole("heading", { name: "There is no map nosuch" }).waitFor({ timeout: 10_000 });
    assert.equal(await page.getByRole("navigation", { name: "Map" }).count(), 0, address);
    await page.close();
  }
  const page = await go("/answers/nosuch");
  await page.getByText(/There is no (answer|result) nosuch/).waitFor({ timeout: 10_000 });
  assert.equal(await page.getByText(/parse|i64/).count(), 0);
});

test("a viewer who opens what he may not do is told so", async () => {
  const { text } = await api("POST", "/tokens", { name: "onlooker", role: "viewer" });
  const guest = await guestOf(world);
  const page = await open(guest, world.origin, "/maps/hall/teach");
  await page.getByLabel("Token").fill(text);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByText("onlooker · viewer").first().waitFor();
  for (const [address, role] of [["/maps/hall/teach", "teacher"], ["/maps/hall/gather", "teacher"]]) {
    await page.goto(`${world.origin}${address}`);
    await page.getByText(`This page needs the role ${role}. You are signed in as onlooker, viewer.`).waitFor({ timeout: 10_000 });
    assert.equal(await page.locator("input[type=file]").count(), 0);
  }
  await guest.close();
});

test("a phone shows long words, every value of a table and its buttons, and the map near the top", async () => {
  await api("POST", "/maps", { name: "long-words", site: "s".repeat(50), building: "b".repeat(50) });
  const page = await go("/", PHONE);
  await page.getByRole("link", { name: "hall", exact: true }).waitFor();
  await check(page, "long-building-phone");
  await page.goto(`${world.origin}/robots`);
  const remove = page.getByRole("button", { name: "Remove mower" });
  await remove.waitFor();
  const inside = async (locator) => {
    const box = await locator.boundingBox();
    return box.x >= 0 && box.x + box.width <= PHONE.width;
  };
  assert.ok(await inside(remove), "the button is in sight");
  assert.ok(await inside(page.getByRole("cell", { name: "none yet" })), "so is the last landmark");
  await check(page, "robots-cards-phone");
  await page.goto(`${world.origin}/maps/hall`);
  const floor = page.getByRole("application");
  await floor.waitFor();
  const { y } = await floor.boundingBox();
  assert.ok(y < 320, `the map begins at ${y} px`);
  await check(page, "map-near-the-top-phone");
});

test("a floor plan that is saved is shown whole, and its form is closed", async () => {
  await api("POST", "/maps", { name: "fitted" });
  const page = await go("/maps/fitted?view=0,0,0.02,0");
  await page.getByRole("button", { name: "Floor plan" }).click();
  await page.getByLabel("Picture (PNG or JPEG)").setInputFiles({ name: "plan.png", mimeType: "image/png", buffer: await roomPlan(world) });
  await page.getByLabel("A length in the picture, pixels").fill("360");
  await page.getByLabel("The same length on the floor, metres").fill("18");
  await page.getByRole("button", { name: "Save the floor plan" }).click();
  await page.getByText("The floor plan is set.").waitFor();
  assert.equal(await page.getByRole("button", { name: "Save the floor plan" }).count(), 0, "the form is closed");
  // 20 m by 12 m: its middle is that of the view.
  await page.waitForURL(/view=10\.0\d(,|%2C)6\.0\d/, { timeout: 10_000 });
});

test("back from a landmark leads to the place of the list that one came from", async () => {
  await api("POST", "/maps", { name: "many" });
  for (let i = 0; i < 60; i++) await api("POST", "/maps/many/landmarks", { name: `door-${String(i).padStart(2, "0")}` });
  const page = await go("/maps/many/landmarks");
  const far = page.getByRole("link", { name: /door-50/ });
  await far.scrollIntoViewIfNeeded();
  await page.waitForTimeout(300);
  const before = await page.evaluate(() => scrollY);
  assert.ok(before > 300, `scrolled by ${before} px`);
  await far.click();
  await page.getByRole("heading", { name: /door-50/, level: 1 }).waitFor();
  await page.goBack();
  await page.waitForFunction((before) => Math.abs(scrollY - before) < 5, before, { timeout: 10_000 });
});

test("a printed map has the names of its landmarks", async () => {
  const page = await go("/maps/hall");
  await page.getByRole("region", { name: "Landmarks", exact: true }).getByRole("button", { name: "poster" }).waitFor();
  await page.emulateMedia({ media: "print" });
  assert.ok(await page.getByRole("region", { name: "Landmarks", exact: true }).getByText("poster", { exact: true }).isVisible());
});

test("the licences that the pages lead to are those of what is bundled", async () => {
  const page = await go("/admin");
  await page.getByRole("link", { name: "Licences" }).waitFor();
  const served = await (await world.context.request.get(`${world.origin}/licences.txt`)).text();
  const { dependencies } = JSON.parse(readFileSync(new URL("../../package.json", import.meta.url), "utf8"));
  for (const name of Object.keys(dependencies)) assert.ok(served.includes(`\n${name} `), name);
});
