// Journeys from a floor plan to walls and to the first placed landmark: walls are traced, moved, removed, offered of the plan.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, check, eventually, journeys, layPlan, pixels, roomPlan } from "./harness.js";

const world = journeys();
const { api, go } = world;
const wallsOf = async (map) => (await api("GET", `/maps/${map}/walls`)).segments;

/** A map with the plan of a room, and a landmark without a place. */
async function planned(map) {
  await api("POST", "/maps", { name: map });
  await api("POST", `/maps/${map}/landmarks`, { name: "sign", size: { width_m: 0.6, height_m: 0.8 } });
  await layPlan(world, map, await roomPlan(world));
}

/** Where a point of the floor is on the screen. The view of these journeys has its middle at 10, 6. */
async function screen(page, metres_of_a_pixel) {
  const floor = page.getByRole("application");
  await floor.evaluate((element) => element.scrollIntoView({ block: "center" }));
  const box = await floor.boundingBox();
  return (x, y) => [box.x + box.width / 2 + (x - 10) / metres_of_a_pixel, box.y + box.height / 2 - (y - 6) / metres_of_a_pixel];
}

const near = (wall, [ax, ay, bx, by]) => {
  const off = (values) => Math.max(...values.map(([got, wanted]) => Math.abs(got - wanted)));
  const { a, b } = wall;
  return Math.min(off([[a[0], ax], [a[1], ay], [b[0], bx], [b[1], by]]), off([[b[0], ax], [b[1], ay], [a[0], bx], [a[1], by]])) < 0.15;
};

for (const [size, where, scale] of [[undefined, "desk", 0.03], [PHONE, "phone", 0.06]]) {
  test(`walls are traced on a plan and the first landmark is placed within twelve clicks, at the ${where}`, async () => {
    const map = `traced-${where}`;
    await planned(map);
    const page = await go(`/maps/${map}?view=10,6,${scale},0`, size);
    let clicks = 0;
    const press = async (locator) => {
      clicks += 1;
      await locator.click();
    };
    const at = async (x, y) => {
      clicks += 1;
      await page.mouse.click(...(await screen(page, scale))(x, y));
    };
    await press(page.getByRole("button", { name: "Trace walls" }));
    await page.getByText("Click where a wall begins.").waitFor();
    // A little beside: right angles and ends snap.
    await at(1, 1);
    await at(19, 1.3);
    await at(19.2, 11);
    await at(1.2, 11.2);
    await at(1.1, 1.1);
    assert.equal((await wallsOf(map)).length, 0, "nothing is stored before it is saved");
    await check(page, `walls-${where}`);
    await press(page.getByRole("button", { name: "Save the walls" }));
    await page.getByText("The walls are saved: 4 drawn or moved, 0 taken away or moved.").waitFor();
    const walls = await wallsOf(map);
    assert.equal(walls.length, 4);
    for (const { a, b } of walls) assert.ok(Math.abs(a[0] - b[0]) < 1e-6 || Math.abs(a[1] - b[1]) < 1e-6, `${a} to ${b} is square`);
    const corners = new Set(walls.flatMap(({ a, b }) => [a, b]).map(([x, y]) => `${x.toFixed(6)} ${y.toFixed(6)}`));
    assert.equal(corners.size, 4, "ends meet");
    await press(page.getByRole("region", { name: "Landmarks", exact: true }).getByRole("button", { name: "sign" }));
    await press(page.getByRole("button", { name: "Place on the map" }));
    const top = Math.max(...walls.map(({ a }) => a[1]));
    await at(10, top - 0.3);
    await page.getByText(/^On the wall at/).waitFor();
    assert.equal(await page.getByLabel("Faces, degrees").inputValue(), "270", "the wall gives the direction");
    await page.getByLabel("Centre above the floor, m").fill("1.6");
    await press(page.getByRole("button", { name: "Save the place" }));
    await page.getByText(/sign is on the wall at .* 1\.60 m above the floor, and faces 270°/).waitFor();
    const { place } = await api("GET", `/maps/${map}/landmarks/sign`);
    assert.ok(Math.abs(place.y_m - top) < 1e-6 && place.z_m === 1.6, JSON.stringify(place));
    assert.ok(clicks <= 12, `${clicks} clicks`);
    assert.deepEqual(page.faults, []);
  });
}

test("a single wall is chosen, moved, removed, and saved with a way back", async () => {
  await api("POST", "/maps", { name: "single" });
  const stored = [{ a: [6, 4], b: [14, 4], covariance: [1e-6, 0, 1e-4] }, { a: [6, 8], b: [14, 8] }];
  await api("PUT", "/maps/single/walls", { segments: stored }, { "if-match": "*" });
  const page = await go("/maps/single?view=10,6,0.03,0");
  await page.getByRole("button", { name: "Trace walls" }).click();
  await page.getByRole("button", { name: "Choose" }).click();
  const to = await screen(page, 0.03);
  await page.mouse.click(...to(10, 8.1));
  await page.getByText("Drag the wall, or one of its ends; or remove it.").waitFor();
  await page.mouse.move(...to(10, 8));
  await page.mouse.down();
  await page.mouse.move(...to(10, 9), { steps: 6 });
  await page.mouse.up();
  await page.mouse.click(...to(10, 4));
  await page.keyboard.press("Delete");
  await page.getByRole("button", { name: "One step back" }).click();
  await page.getByRole("button", { name: "Save the walls" }).click();
  await page.getByText(/The walls are saved/).waitFor();
  const moved = await wallsOf("single");
  assert.ok(moved.length === 2 && near(moved[1], [6, 9, 14, 9]), JSON.stringify(moved));
  assert.deepEqual(moved[0], stored[0], "what nobody touched is as it was, with how well it is known");
  await page.getByRole("button", { name: "Trace walls" }).click();
  await page.getByRole("button", { name: "Choose" }).click();
  await page.mouse.click(...(await screen(page, 0.03))(10, 4));
  await page.getByRole("button", { name: "Remove this wall" }).click();
  await page.getByRole("button", { name: "Save the walls" }).click();
  const told = page.getByRole("status").filter({ hasText: "0 drawn or moved, 1 taken away" });
  await told.waitFor();
  assert.equal((await wallsOf("single")).length, 1);
  await told.getByRole("button", { name: "Undo" }).click();
  await page.getByText(/2 wall segments/).waitFor();
  assert.equal((await wallsOf("single")).length, 2);
});

test("walls that are found in a plan are shown, and stored only when they are taken", async () => {
  await planned("found");
  const page = await go("/maps/found?view=10,6,0.03,0");
  await page.getByRole("button", { name: "Trace walls" }).click();
  await page.getByRole("button", { name: "Find walls in the plan" }).click();
  await page.getByText("4 lines of the plan may be walls").waitFor();
  await check(page, "walls-offered");
  assert.equal((await wallsOf("found")).length, 0);
  await page.getByRole("button", { name: "Leave them out" }).click();
  assert.ok(await page.getByRole("button", { name: "Save the walls" }).isDisabled());
  await page.getByRole("button", { name: "Find walls in the plan" }).click();
  await page.getByRole("button", { name: "Take 4 walls" }).click();
  await page.getByRole("button", { name: "Save the walls" }).click();
  await page.getByText("The walls are saved: 4 drawn or moved").waitFor();
  const walls = await wallsOf("found");
  for (const wanted of [[1, 1, 19, 1], [1, 11, 19, 11], [1, 1, 1, 11], [19, 1, 19, 11]]) assert.ok(walls.some((wall) => near(wall, wanted)), `${wanted} of ${JSON.stringify(walls)}`);
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`walls of a file are shown over those of the map, and taken beside or instead of them, at the ${where}`, async () => {
    const map = `imported-${where}`;
    await api("POST", "/maps", { name: map });
    const old = [{ a: [0, 0], b: [8, 0] }];
    await api("PUT", `/maps/${map}/walls`, { segments: old }, { "if-match": "*" });
    const page = await go(`/maps/${map}?view=4,0,0.03,0`, size);
    const open = async (name, text, unit_m) => {
      await page.getByRole("button", { name: "Walls of a file" }).click();
      const dialog = page.getByRole("dialog");
      await dialog.locator("input[type=file]").setInputFiles({ name, mimeType: "application/octet-stream", buffer: Buffer.from(text) });
      if (unit_m) await dialog.getByLabel(/^Metres of one unit/).fill(unit_m);
      await dialog.getByRole("button", { name: "Show the walls" }).click();
      return dialog;
    };
    await page.getByRole("button", { name: "Trace walls" }).click();
    const refused = await open("plan.svg", '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 2"><path stroke="red" d="M0 1H8"/></svg>');
    await refused.getByText(/the plan has no scale/i).waitFor();
    // The browser itself writes down that it was refused.
    assert.match(page.faults.splice(0).join(), /^[^,]*422 \(Unprocessable Entity\)$/);
    await refused.getByLabel(/^Metres of one unit/).fill("0.5");
    await refused.getByRole("button", { name: "Show the walls" }).click();
    await page.getByText("plan.svg has 2 walls, 8.00 m in all: they are dashed on the map.").waitFor();
    await page.getByRole("button", { name: "Leave them out" }).click();
    // 60 m away: all of it comes in sight.
    const line = { type: "LineString", coordinates: [[60, 3], [60, 9], [66, 9]] };
    await open("hall.geojson", JSON.stringify({ type: "FeatureCollection", features: [{ type: "Feature", properties: {}, geometry: line }] }));
    await page.getByText("hall.geojson has 2 walls, 12.00 m in all: they are dashed on the map. Nothing is stored before you save.").waitFor();
    await page.getByRole("application").scrollIntoViewIfNeeded();
    await page.waitForTimeout(500);
    assert.ok((await pixels(page.locator(".canvas"), [0xc2, 0x41, 0x0c])) > 20, "what the file has is drawn, and in sight");
    await check(page, `walls-of-a-file-${where}`);
    assert.deepEqual(await wallsOf(map), old, "nothing is stored before it is saved");
    await page.getByRole("button", { name: "Take 2 walls" }).click();
    await page.getByRole("button", { name: "Save the walls" }).click();
    await page.getByText("The walls are saved: 2 drawn or moved, 0 taken away or moved.").waitFor();
    assert.equal((await wallsOf(map)).length, 3);
    await page.getByRole("button", { name: "Trace walls" }).click();
    await open("list.txt", "0, 0, 2, 0\n");
    await page.getByRole("button", { name: "Take them instead of the 3 walls of the map" }).click();
    await page.getByRole("button", { name: "Save the walls" }).click();
    await page.getByText("The walls are saved: 1 drawn or moved, 3 taken away or moved.").waitFor();
    assert.deepEqual(await wallsOf(map), [{ a: [0, 0], b: [2, 0] }]);
    assert.deepEqual(page.faults, []);
  });

  test(`walls of scans are shown before they replace any, and are taken or given up, at the ${where}`, async () => {
    const map = `scanned-${where}`;
    await api("POST", "/maps", { name: map });
    const old = [{ a: [0, 0], b: [8, 0] }];
    await api("PUT", `/maps/${map}/walls`, { segments: old }, { "if-match": "*" });
    await api("PUT", `/robots/sweeper-${where}`, { map });
    const page = await go(`/maps/${map}/settings?part=scans`, size);
    // No robot with a laser drives here: what the server says of one is given here. The server's part is tested by
    // `a_drive_over_zenoh_gives_the_walls_of_its_scan_log`.
    const found = [[0, 0.1, 8.1, 0.1], [8.1, 0.1, 8.1, 5]].map(([ax, ay, bx, by]) => ({ a: [ax, ay], b: [bx, by], covariance: [1e-6, 0, 1e-4] }));
    const asked = [];
    let stage = "mapping";
    const told = () => ({ map, robot: `sweeper-${where}`, stage, scans: 400, dropped: 0, distance_m: 31.5, frames: 60, ...(stage !== "mapping" && { segments: 2, landmarks: 3, left_out: [{ x_m: 4.04, y_m: -1.3, z_m: 1.05, width_m: 0.95, height_m: 2.1, views: 12, reason: "it stands on the floor" }] }), ...(stage === "found" && { walls: found }), ...(stage === "done" && { gathering: 5 }) });
    await page.route(new RegExp(`/maps/${map}/mapping(/finish)?(\\?.*)?$`), async (route) => {
      const request = route.request();
      const { pathname, search } = new URL(request.url());
      if (request.method() !== "GET") asked.push(`${request.method()} ${pathname.split("/").at(-1)}${search}`);
      if (request.method() === "DELETE") return route.fulfill({ status: 204 });
      if (pathname.endsWith("/finish")) {
        stage = search ? "found" : "done";
        if (!search) await api("PUT", `/maps/${map}/walls`, { segments: found }, { "if-match": "*" });
        return route.fulfill({ status: 202, json: told() });
      }
      if (request.method() === "POST") stage = "mapping";
      return route.fulfill({ json: told() });
    });
    const finish = async () => {
      await page.getByLabel("Robot").selectOption(`sweeper-${where}`);
      await page.getByRole("button", { name: "Begin to map" }).click();
      await page.getByRole("button", { name: "Finish" }).click();
      await page.getByRole("dialog").getByRole("button", { name: "Finish" }).click();
      await page.getByRole("heading", { name: "2 walls found" }).waitFor();
    };
    await finish();
    await page.getByText("3 landmarks found; they are proposed once the walls are taken").waitFor();
    await page.getByText("1 object, and why").click();
    await page.getByText("0.95 x 2.10 m at 4.0, -1.3, 12 views: it stands on the floor").waitFor();
    await page.getByText(/Dashed: what the scans were taken for\. Plain: the 1 wall of the map, which they replace\. Nothing is replaced so far\./).waitFor();
    await page.getByRole("application").scrollIntoViewIfNeeded();
    await page.waitForTimeout(500);
    assert.ok((await pixels(page.locator(".canvas"), [0xc2, 0x41, 0x0c])) > 100, "what was found is drawn, all of it in sight");
    await check(page, `walls-of-scans-${where}`);
    await page.getByRole("button", { name: "Give them up" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Give it up" }).click();
    await page.getByText("The mapping is given up. The map is as it was.").waitFor();
    assert.deepEqual(await wallsOf(map), old);
    await finish();
    await page.getByRole("button", { name: "Replace the walls" }).click();
    const done = page.getByRole("status").filter({ hasText: "The map has 2 wall segments of these scans." });
    await done.waitFor();
    assert.deepEqual(asked, ["POST mapping", "POST finish?hold=true", "DELETE mapping", "POST mapping", "POST finish?hold=true", "POST finish"]);
    assert.equal((await wallsOf(map)).length, 2);
    assert.equal(await page.getByRole("link", { name: "look at them and accept them" }).getAttribute("href"), `/maps/${map}/gather`);
    await done.getByRole("button", { name: "Undo" }).click();
    await eventually("way back", async () => (await wallsOf(map)).length === 1);
    assert.deepEqual(page.faults, []);
  });
}

/** A plan of an L-shaped wall, 5 cm a pixel, whose upright leg leans by 10 degrees. */
async function leaning(map) {
  const page = await go("/");
  const base64 = await page.evaluate(() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 400, height: 240 });
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, 400, 240);
    pen.lineWidth = 4;
    pen.beginPath();
    pen.moveTo(60, 200);
    pen.lineTo(300, 200);
    pen.moveTo(60, 200);
    pen.lineTo(60 + 160 * Math.tan(Math.PI / 18), 40);
    pen.stroke();
    return canvas.toDataURL("image/png").split(",")[1];
  });
  await page.close();
  await api("POST", "/maps", { name: map });
  await layPlan(world, map, Buffer.from(base64, "base64"));
}

test("walls that are traced beside the lines of a plan lie on them, oblique ones too", async () => {
  await leaning("leaning");
  const page = await go("/maps/leaning?view=10,6,0.03,0");
  await page.getByRole("button", { name: "Trace walls" }).click();
  await page.getByText("Click where a wall begins.").waitFor();
  const at = await screen(page, 0.03);
  const [top, right] = [[3 + 8 * Math.tan(Math.PI / 18), 10], [15, 2]];
  // Each click is 15 cm beside the line.
  await page.mouse.click(...at(right[0] - 2, right[1] + 0.15));
  await page.mouse.click(...at(5, 1.85));
  await page.keyboard.press("Escape");
  await page.mouse.click(...at(3 + 2 * Math.tan(Math.PI / 18) + 0.15, 4));
  await page.getByText("Click where the wall ends: lines of the plan, corners and right angles snap.").waitFor();
  await page.mouse.click(...at(top[0] - 1.5 * Math.tan(Math.PI / 18) + 0.15, top[1] - 1.5));
  await page.getByRole("button", { name: "Save the walls" }).click();
  await page.getByText("The walls are saved: 2 drawn").waitFor();
  const [level, oblique] = await wallsOf("leaning");
  for (const [x, y] of [level.a, level.b]) assert.ok(Math.abs(y - 2) < 0.03, `${x}, ${y} is on the line`);
  for (const [x, y] of [oblique.a, oblique.b]) assert.ok(Math.abs(x - 3 - (y - 2) * Math.tan(Math.PI / 18)) < 0.04, `${x}, ${y} is on the line`);
});
