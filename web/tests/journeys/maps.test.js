// Journeys on a map of a running server: its view, its tools, its settings; at a desk and on a phone.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { PHONE, SOON, check, demo, journeys } from "./harness.js";

const world = journeys({ start: demo });
const { api, go } = world;
/** The name of the demo's map. */
const MAP = "corridor";

test("maps are made, renamed, copied and deleted", async () => {
  const page = await go("/");
  await page.getByRole("link", { name: MAP, exact: true }).waitFor();
  await check(page, "maps");
  await page.getByRole("button", { name: "New map" }).click();
  await page.getByRole("textbox", { name: "Name" }).fill("hall");
  await page.getByLabel("Building").fill("Main house");
  await page.getByLabel("Floor").fill("2");
  await page.getByRole("button", { name: "Create" }).click();
  await page.getByRole("heading", { name: "hall" }).waitFor();
  await page.getByRole("link", { name: "Waymark" }).click();
  await page.getByRole("heading", { name: "Main house" }).waitFor();
  await page.getByRole("button", { name: "Rename hall" }).click();
  await page.getByRole("dialog").getByLabel("Name").fill("great-hall");
  await page.getByRole("button", { name: "Save" }).click();
  await page.getByRole("button", { name: "Copy great-hall" }).click();
  await page.getByRole("button", { name: "Copy", exact: true }).click();
  await page.getByRole("link", { name: "great-hall-2" }).waitFor();
  await page.getByRole("button", { name: "Delete great-hall-2" }).click();
  const question = page.getByRole("dialog");
  await question.getByRole("textbox").fill("great-hall");
  await question.getByRole("button", { name: "Delete the map" }).click();
  await question.getByRole("alert").waitFor();
  await question.getByRole("textbox").fill("great-hall-2");
  await question.getByRole("button", { name: "Delete the map" }).click();
  await page.getByRole("link", { name: "great-hall-2" }).waitFor({ state: "detached" });
  const names = (await api("GET", "/maps")).items.map(({ name }) => name);
  assert.ok(names.includes("great-hall") && !names.includes("great-hall-2"), names.join());
  assert.deepEqual(page.faults, []);
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`a map shows its robots, landmarks and what is seen from a point, at the ${where}`, async () => {
    const page = await go(`/maps/${MAP}`, size);
    await page.getByRole("heading", { name: MAP, level: 1 }).waitFor();
    await page.getByRole("region", { name: "Robots on this map" }).getByText("Live").first().waitFor();
    const canvas = page.getByRole("application");
    await page.getByRole("button", { name: "Show everything" }).click();
    const list = page.getByRole("region", { name: "Landmarks", exact: true });
    await list.getByRole("listitem").first().getByRole("button").focus();
    await page.keyboard.press("Enter");
    await page.getByRole("region", { name: "Chosen landmark" }).waitFor();
    assert.match(page.url(), /landmark=/, "the chosen landmark is in the address");
    await page.getByRole("button", { name: "Visible landmarks here" }).click();
    const box = await canvas.boundingBox();
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.getByText(/A robot here may see \d+ landmarks?\./).waitFor();
    await page.getByRole("button", { name: "Measure" }).click();
    await page.mouse.click(box.x + box.width / 3, box.y + box.height / 2);
    await page.waitForTimeout(400); // two clicks that follow fast are one double click, which zooms
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.getByText(/Length: \d+\.\d\d m/).waitFor();
    await page.getByRole("button", { name: "Check a path" }).click();
    // The choice of a path beside it has moved the map down.
    await page.getByLabel("Path").waitFor();
    const lower = await canvas.boundingBox();
    await page.mouse.click(lower.x + lower.width / 3, lower.y + lower.height / 2);
    await page.waitForTimeout(400);
    await page.mouse.click(lower.x + (3 * lower.width) / 4, lower.y + lower.height / 2);
    await page.getByText(/a landmark is seen\. \d+ blind parts?/).waitFor();
    await check(page, `map-${where}`);
  });
}

test("a map shows where odometry alone and a simulator say that robots are", async () => {
  const page = await go(`/maps/${MAP}`);
  await page.getByRole("region", { name: "Robots on this map" }).getByText("Live").first().waitFor();
  const blue = () =>
    page.evaluate(() =>
      [...document.querySelectorAll(".floor canvas")].reduce((sum, canvas) => {
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        for (let i = 0; i < data.length; i += 4) sum += data[i] < 60 && data[i + 1] < 110 && data[i + 2] > 190 && data[i + 3] > 200;
        return sum;
      }, 0),
    );
  const before = await blue();
  await page.getByText("Layers", { exact: true }).click();
  await page.getByLabel("Odometry (dashed), truth of a simulator", { exact: true }).check();
  await page.waitForURL(/off=none/);
  const until = Date.now() + SOON;
  while ((await blue()) < before + 20 && Date.now() < until) await page.waitForTimeout(300);
  assert.ok((await blue()) >= before + 20, `pixels of the true track: ${before} before, ${await blue()} after`);
  await page.reload();
  assert.ok(await page.getByLabel("Odometry (dashed), truth of a simulator", { exact: true }).isChecked(), "the layer is in the address");
  assert.deepEqual(page.faults, []);
});

test("a floor plan is laid beneath a map by a measured length", async () => {
  await api("POST", "/maps", { name: "plan" });
  const page = await go("/maps/plan");
  await page.getByRole("button", { name: "Floor plan" }).click();
  const png = await page.evaluate(() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 200, height: 100 });
    canvas.getContext("2d").fillRect(20, 20, 160, 60);
    return canvas.toDataURL("image/png").split(",")[1];
  });
  await page.getByLabel("Picture (PNG or JPEG)").setInputFiles({ name: "floor.png", mimeType: "image/png", buffer: Buffer.from(png, "base64") });
  await page.getByLabel("A length in the picture, pixels").fill("160");
  await page.getByLabel("The same length on the floor, metres").fill("8");
  await page.getByRole("button", { name: "Save the floor plan" }).click();
  await page.getByText("The floor plan is set.").waitFor();
  const { place } = await api("GET", "/maps/plan/underlay");
  assert.ok(Math.abs(place.metres_per_pixel - 0.05) < 1e-9, JSON.stringify(place));
  await check(page, "floor-plan");
});

test("a landmark is moved on the map and snaps to a wall", async () => {
  await api("POST", "/maps", { name: "room" });
  await api("PUT", "/maps/room/walls", { segments: [{ a: [-4, 2], b: [4, 2] }, { a: [-4, -2], b: [4, -2] }] }, { "if-match": "*" });
  const size = { width_m: 0.6, height_m: 0.8 };
  await api("POST", "/maps/room/landmarks", { name: "sign", size, place: { x_m: -3, y_m: 2, z_m: 1.4, theta_rad: -Math.PI / 2, roll_rad: 0, tilt_rad: 0 } });
  const page = await go("/maps/room?landmark=sign&view=0,0,0.02,0");
  await page.getByRole("button", { name: "Move" }).click();
  await page.getByRole("button", { name: "Save the place" }).waitFor();
  const box = await page.getByRole("application").boundingBox();
  // 1 m to the right of the middle, 1.8 m below it: 20 cm before the lower wall.
  await page.mouse.click(box.x + box.width / 2 + 50, box.y + box.height / 2 + 90);
  await page.getByText(/^On the wall at/).waitFor();
  assert.equal((await api("GET", "/maps/room/landmarks/sign")).place.y_m, 2, "nothing is stored before it is saved");
  await page.getByRole("button", { name: "Save the place" }).click();
  await page.getByText(/sign is on the wall/).waitFor();
  const { place } = await api("GET", "/maps/room/landmarks/sign");
  assert.ok(Math.abs(place.y_m + 2) < 1e-9 && Math.abs(place.x_m - 1) < 0.1, JSON.stringify(place));
  assert.ok(Math.abs(place.theta_rad - Math.PI / 2) < 1e-9, "it faces the room");
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForTimeout(500);
  assert.equal((await api("GET", "/maps/room/landmarks/sign")).place.y_m, 2);
  // By a drag, to 0.3 m before the lower wall.
  await page.getByRole("button", { name: "Move", exact: true }).click();
  await page.getByRole("button", { name: "Save the place" }).waitFor();
  const now = await page.getByRole("application").boundingBox();
  await page.mouse.move(now.x + now.width / 2 - 150, now.y + now.height / 2 - 100);
  await page.mouse.down();
  await page.mouse.move(now.x + now.width / 2 - 100, now.y + now.height / 2 + 85, { steps: 8 });
  await page.mouse.up();
  await page.getByRole("button", { name: "Save the place" }).click();
  await page.getByText(/sign is on the wall at -2\.\d\d m, -2\.00 m/).waitFor();
  await check(page, "landmark-moved");
});

test("a person tells a robot where it is", async () => {
  const page = await go(`/maps/${MAP}`);
  await page.getByRole("region", { name: "Robots on this map" }).getByText("Live").first().waitFor();
  await page.getByRole("button", { name: "Set robot position" }).click();
  const robot = await page.getByLabel("Robot", { exact: true }).inputValue();
  const box = await page.getByRole("application").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  await page.getByText("Now click where it looks.").waitFor();
  await page.waitForTimeout(400);
  await page.mouse.click(box.x + box.width / 2 + 60, box.y + box.height / 2);
  await page.getByText(`${robot} is told where it is`).waitFor();
  // The same by one drag, which leaves the map where it was.
  await page.getByRole("button", { name: "Set robot position" }).click();
  const view = new URL(page.url()).searchParams.get("view");
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2 - 40, { steps: 5 });
  const asked = page.waitForRequest((request) => request.method() === "PUT" && request.url().endsWith(`/robots/${robot}/pose`));
  await page.mouse.up();
  assert.ok(Math.abs((await asked).postDataJSON().theta_rad - Math.PI / 2) < 0.05, (await asked).postData());
  await page.getByText(`${robot} is told where it is`).nth(1).waitFor();
  assert.equal(new URL(page.url()).searchParams.get("view"), view, "the map stays");
  assert.deepEqual(page.faults, []);
});

test("the blind parts of what a robot drove are shown", async () => {
  const page = await go(`/maps/${MAP}`);
  await page.getByRole("region", { name: "Robots on this map" }).getByText("Live").first().waitFor();
  await page.getByRole("button", { name: "Check a path" }).click();
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  await page.getByLabel("Path").selectOption(robot);
  await page.getByText(/From \d+ % of \d+\.\d\d m a landmark is seen\. \d+ blind parts?/).waitFor();
  await check(page, "driven-path");
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`where landmarks are seen is drawn, and sheets are printed, at the ${where}`, async () => {
    const page = await go(`/maps/${MAP}`, size);
    await page.getByRole("button", { name: "Coverage" }).click();
    await page.getByText(/Areas of ([1-9]\d*) of \1 landmarks? with size and place/).waitFor();
    await check(page, `seen-${where}`);
    await page.goto(`/maps/${MAP}/sheet`);
    await page.getByRole("img", { name: "The floor from above" }).waitFor();
    await check(page, `floor-sheet-${where}`);
    const first = (await api("GET", `/maps/${MAP}/landmarks`)).items.find(({ place }) => place);
    await page.goto(`/maps/${MAP}/landmarks/${first.name}/sheet`);
    await page.getByRole("img", { name: "The floor from above" }).waitFor();
    await check(page, `landmark-sheet-${where}`);
  });

  test(`settings of a map are read and changed, at the ${where}`, async () => {
    const page = await go(`/maps/${MAP}/settings`, size);
    for (const part of ["Position in the building", "Camera assumed for coverage", "When a landmark is used", "Which sensor to trust, where", "Walls from scans"]) {
      await page.getByRole("button", { name: part }).click();
      await page.getByRole("heading", { name: part }).waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await check(page, `settings-${part.toLowerCase().replaceAll(" ", "-")}-${where}`);
    }
  });
}

test("a map lies in another, has a camera, a named area and a choice of what is fused", async () => {
  await api("POST", "/maps", { name: "upstairs" });
  const page = await go("/maps/upstairs/settings");
  await page.getByLabel("It lies in the map").selectOption(MAP);
  await page.getByLabel("Its floor above that one, m").fill("3.2");
  await page.getByLabel("Turned left by, degrees").fill("90");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText(`upstairs lies in ${MAP} now.`).waitFor();
  const { parent } = await api("GET", "/maps/upstairs");
  assert.ok(parent.level_m === 3.2 && Math.abs(parent.theta_rad - Math.PI / 2) < 1e-6, JSON.stringify(parent));
  await page.getByRole("button", { name: "Camera assumed for coverage" }).click();
  await page.getByLabel("Camera above the floor, m").fill("0.9");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText(/The camera is set/).waitFor();
  assert.equal((await api("GET", "/maps/upstairs/visibility-settings")).camera_height_m, 0.9);
  await page.getByRole("button", { name: "When a landmark is used" }).click();
  await page.getByLabel("Fewest views, 1 to 200").fill("0");
  await page.getByLabel("Why").fill("doors look alike");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText(/^Fewest views: .*1 to 200/).waitFor();
  // The browser itself says this of the refusal, once.
  const said = page.faults.splice(0);
  assert.ok(said.length === 1 && /status of 422/.test(said[0]), said.join());
  await page.getByLabel("Fewest views, 1 to 200").fill("4");
  await page.getByLabel("A landmark that was photographed from one side only").selectOption("is not used");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText("upstairs has gates of its own: doors look alike").waitFor();
  assert.deepEqual((await api("GET", "/maps/upstairs")).learning, { min_views: 4, reason: "doors look alike", refuse_one_side: true });
  await page.getByRole("button", { name: "Use the server's gates" }).click();
  await page.getByText("upstairs has the server's gates again.").waitFor();
  assert.equal(await page.getByLabel("Fewest views, 1 to 200").inputValue(), "");
  assert.equal((await api("GET", "/maps/upstairs")).learning ?? null, null);
  await page.getByRole("button", { name: "Which sensor to trust, where" }).click();
  await page.getByLabel(/^Where runs have told/).selectOption("best");
  await page.getByText("The choice is kept.").waitFor();
  await page.getByRole("button", { name: "Name an area" }).click();
  await page.getByRole("application").evaluate((floor) => floor.scrollIntoView({ block: "center" }));
  const box = await page.getByRole("application").boundingBox();
  for (const [dx, dy] of [[-60, -60], [60, -60], [60, 60]]) {
    await page.mouse.click(box.x + box.width / 2 + dx, box.y + box.height / 2 + dy);
    await page.waitForTimeout(400);
  }
  await page.getByLabel("Name of the area").fill("lobby");
  await page.getByRole("button", { name: "Keep the area" }).click();
  await page.getByText("The area lobby is kept.").waitFor();
  const { fusion_mode, areas } = await api("GET", "/maps/upstairs/modalities");
  assert.deepEqual([fusion_mode, areas.map(({ name, corners_m }) => [name, corners_m.length])], ["best", [["lobby", 3]]]);
  assert.deepEqual(page.faults, []);
});

test("walls are made of a robot's scans, or the drive is given up", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const page = await go(`/maps/${MAP}/settings?part=scans`);
  await page.getByLabel("Robot").selectOption(robot);
  await page.getByRole("button", { name: "Begin to map" }).click();
  await page.getByText(/scans are being mapped/).waitFor();
  await page.getByRole("button", { name: "Give it up" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Give it up" }).click();
  await page.getByText("The mapping is given up.").waitFor();
  assert.deepEqual(page.faults, []);
});

test("two clicks on a map of a site give a route through its places", async () => {
  await api("PATCH", `/maps/${MAP}`, { site: "Works" }, { "if-match": "*" });
  const page = await go(`/maps/${MAP}`);
  await page.getByRole("button", { name: "Route", exact: true }).click();
  await page.getByText(/\d+ places?, \d+ passages?\./).waitFor();
  const box = await page.getByRole("application").boundingBox();
  await page.mouse.click(box.x + box.width / 3, box.y + box.height / 2);
  await page.getByText("Now click where the route ends.").waitFor();
  await page.waitForTimeout(400); // two clicks that follow fast are one double click, which zooms
  await page.mouse.click(box.x + (3 * box.width) / 4, box.y + box.height / 2);
  await page.getByRole("list", { name: "Route" }).getByText(new RegExp(`Through ${MAP}/\\d+`)).first().waitFor();
  await check(page, "route");
});

test("a map is saved as a file and loaded under another name", async () => {
  const page = await go(`/maps/${MAP}/settings`);
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Export map" }).click()]);
  assert.equal(download.suggestedFilename(), `${MAP}.zip`);
  const file = await download.path();
  await page.goto("/");
  await page.getByRole("button", { name: "Import map" }).click();
  await page.getByRole("dialog").getByLabel("File", { exact: true }).setInputFiles({ name: "map.zip", mimeType: "application/zip", buffer: await readFile(file) });
  await page.getByRole("dialog").getByLabel(/New name/).fill("twin");
  await page.getByRole("button", { name: "Import", exact: true }).click();
  await page.getByRole("heading", { name: "twin", level: 1 }).waitFor();
  const [a, b] = [await api("GET", `/maps/${MAP}`), await api("GET", "/maps/twin")];
  assert.equal(a.landmarks, b.landmarks);
  assert.deepEqual(page.faults, []);
});
