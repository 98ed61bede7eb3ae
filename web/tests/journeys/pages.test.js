// Journeys of an administrator through the pages of a running server, at a desk and on a phone.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, afterEach, before, test } from "node:test";
import { PHONE, SOON, asker, browser, check, demo, open } from "./harness.js";

let server, its, api;
before(async () => {
  server = await demo();
  its = await browser(server);
  api = asker(its, server);
});
after(async () => {
  await its?.close();
  await server?.stop();
});

// Open pages hold streams, and a browser has six connections to a server.
afterEach(() => Promise.all(its.context.pages().map((page) => page.close())));

const go = (address, size) => open(its.context, server.origin, address, size);
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
  await page.getByRole("button", { name: "Make it" }).click();
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
    await page.getByRole("button", { name: "What is seen from here" }).click();
    const box = await canvas.boundingBox();
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.getByText(/A robot here may see \d+ landmarks?\./).waitFor();
    await page.getByRole("button", { name: "Measure" }).click();
    await page.mouse.click(box.x + box.width / 3, box.y + box.height / 2);
    await page.waitForTimeout(400); // two clicks that follow fast are one double click, which zooms
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.getByText(/Length: \d+\.\d\d m/).waitFor();
    await page.getByRole("button", { name: "Check a path" }).click();
    await page.mouse.click(box.x + box.width / 3, box.y + box.height / 2);
    await page.waitForTimeout(400);
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.getByText(/a landmark is seen\. \d+ blind parts?/).waitFor();
    await check(page, `map-${where}`);
  });

  test(`landmarks are found and opened, at the ${where}`, async () => {
    const page = await go(`/maps/${MAP}/landmarks`, size);
    const cards = page.locator("a.one");
    await cards.first().waitFor();
    await check(page, `landmarks-${where}`);
    await page.getByLabel("Shown as").selectOption("table");
    const [first] = (await api("GET", `/maps/${MAP}/landmarks`)).items;
    await page.getByLabel("Name").fill(first.name);
    await page.getByRole("link", { name: first.name, exact: true }).click();
    await page.getByRole("heading", { name: "Photographs", exact: true }).waitFor();
    await page.getByRole("img", { name: /Hausdorff/ }).waitFor();
    await page.getByRole("img", { name: /Photograph \d+/ }).first().waitFor();
    await check(page, `landmark-${where}`);
  });

  test(`a robot is shown with its frame and measures, at the ${where}`, async () => {
    const page = await go("/robots", size);
    await page.getByRole("cell", { name: "Live" }).first().waitFor();
    await check(page, `robots-${where}`);
    await page.getByRole("row").nth(1).getByRole("link").first().click();
    await page.getByRole("img", { name: /Last frame/ }).first().waitFor();
    await page.getByText(/From receipt to answer, ms: \d/).waitFor();
    await check(page, `robot-${where}`);
  });

  test(`answers are listed and opened, at the ${where}`, async () => {
    const page = await go("/answers", size);
    await page.getByLabel("How it ended").selectOption("matched");
    await page.waitForURL(/status=matched/);
    await page.getByRole("cell", { name: "recognised" }).first().waitFor();
    await check(page, `answers-${where}`);
    await page.getByRole("row").nth(1).getByRole("link").first().click();
    await page.getByRole("img", { name: "What the robot saw, upright" }).first().waitFor();
    await page.getByRole("img", { name: /What was learnt of/ }).first().waitFor();
    await check(page, `answer-${where}`);
  });

  test(`the server's parts are shown, at the ${where}`, async () => {
    const page = await go("/admin", size);
    for (const part of ["Health", "Jobs", "Users and tokens", "Audit log", "Backups"]) {
      await page.getByRole("button", { name: part }).click();
      await page.getByRole("heading", { name: part }).waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await check(page, `server-${part.toLowerCase().replaceAll(" ", "-")}-${where}`);
    }
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

test("a landmark is renamed, measured, taken out of use and brought back by undo", async () => {
  const [first] = (await api("GET", `/maps/${MAP}/landmarks`)).items;
  const page = await go(`/maps/${MAP}/landmarks/${first.name}`);
  await page.getByRole("button", { name: "Size" }).click();
  await page.getByLabel("Width, metres").fill("0.77");
  await page.getByRole("button", { name: "Save" }).click();
  await page.getByText("0.77 m wide").waitFor();
  await page.getByRole("button", { name: "Undo" }).click();
  await page.getByText(`${first.size.width_m.toFixed(2)} m wide`).waitFor();
  await page.getByRole("button", { name: "Take out of use" }).click();
  await page.getByText("Out of use").first().waitFor();
  await page.getByRole("button", { name: "It is as it was: use it" }).click();
  await page.getByRole("button", { name: "Take out of use" }).waitFor();
  await page.getByRole("button", { name: "Rename" }).click();
  await page.getByRole("dialog").getByLabel("Name").fill("by-the-door");
  await page.getByRole("dialog").getByRole("button", { name: "Rename" }).click();
  await page.getByRole("heading", { name: /by-the-door/ }).waitFor();
  await check(page, "landmark-renamed");
  await page.goto(`/maps/${MAP}/history`);
  await page.getByRole("button", { name: /Undo change/ }).first().click();
  await page.getByLabel("Why").fill("the old name was right");
  await page.getByRole("button", { name: "Undo it" }).click();
  await page.getByRole("cell", { name: "the old name was right" }).waitFor();
  const names = (await api("GET", `/maps/${MAP}/landmarks`)).items.map(({ name }) => name);
  assert.ok(names.includes(first.name), names.join());
  await check(page, "history");
});

test("two landmarks that are one object are merged", async () => {
  const [first] = (await api("GET", `/maps/${MAP}/landmarks`)).items;
  await api("POST", `/maps/${MAP}/landmarks`, { name: "twin" });
  const page = await go(`/maps/${MAP}/landmarks/${first.name}`);
  await page.getByRole("img", { name: /Points .*named/ }).waitFor();
  await page.getByRole("button", { name: "Merge" }).click();
  await page.getByLabel("The other one").selectOption("twin");
  await check(page, "landmark-merge");
  await page.getByRole("button", { name: "Make them one" }).click();
  await page.getByText(`twin is part of ${first.name} now`).waitFor();
  const names = (await api("GET", `/maps/${MAP}/landmarks`)).items.map(({ name }) => name);
  assert.ok(!names.includes("twin"), names.join());
  assert.deepEqual(page.faults, []);
});

test("a draft is begun, compared, tried and published", async () => {
  const page = await go(`/maps/${MAP}/history`);
  await page.getByRole("button", { name: "Begin a draft" }).click();
  await page.getByLabel("Name of the draft").fill("spring");
  await page.getByRole("button", { name: "Begin", exact: true }).click();
  await page.getByRole("heading", { name: "Draft spring" }).waitFor();
  await api("POST", "/maps/spring/landmarks", { name: "new-door" });
  await page.reload();
  await page.getByText("Publishing would change: 1 landmark added").waitFor();
  await page.getByRole("button", { name: "Try it on the last frames" }).click();
  await page.getByText(/answered as before/).waitFor();
  await check(page, "draft");
  await page.getByRole("button", { name: "Publish" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Publish" }).click();
  await page.getByRole("cell", { name: /Draft published/ }).waitFor();
  await api("GET", `/maps/${MAP}/landmarks/new-door`);
  assert.deepEqual(page.faults, []);
});

test("a landmark is taught by a robot's frame, learnt and tried", async () => {
  await api("POST", "/maps", { name: "school" });
  const [robot] = (await api("GET", "/robots")).items;
  const camera = (await api("GET", `/robots/${robot.name}/cameras`)).cameras[0].name;
  const frame = await its.context.request.get(`${server.origin}/api/v1/robots/${robot.name}/cameras/${camera}/frame`);
  const file = { name: "frame.jpg", mimeType: frame.headers()["content-type"], buffer: await frame.body() };
  const page = await go("/maps/school/teach");
  await page.locator("input[type=file]").first().setInputFiles(file);
  await page.getByRole("button", { name: "Set the corners myself" }).click();
  const corner = page.getByRole("slider", { name: "Corner, top left" });
  await corner.focus();
  await page.keyboard.press("Shift+ArrowLeft");
  await page.getByLabel("Name").fill("window");
  await page.getByLabel("Width, metres").fill("0.8");
  await page.getByLabel("Height, metres").fill("1.2");
  await check(page, "teach");
  await page.getByRole("button", { name: "Add the photograph" }).click();
  await page.getByRole("button", { name: "Learn window" }).click();
  await page.getByText(/window is learnt/).waitFor();
  await page.getByLabel("Photograph to try").setInputFiles(file);
  await page.getByRole("list", { name: "Quads" }).getByRole("listitem").first().waitFor();
  assert.deepEqual(page.faults, []);
  const landmark = await api("GET", "/maps/school/landmarks/window");
  assert.equal(landmark.views, 1);
  assert.equal(landmark.size.width_m, 0.8);
});

test("candidates appear while a robot drives, and are named, accepted or thrown away", async () => {
  const page = await go("/robots");
  await page.getByRole("cell", { name: "Live" }).first().waitFor();
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  await page.goto(`/maps/${MAP}/gather`);
  await page.getByLabel("Robot").selectOption(robot);
  await page.getByLabel("also further views of known landmarks").check();
  await page.getByRole("button", { name: "Begin to gather" }).click();
  await page.getByRole("article", { name: /Candidate \d+/ }).first().waitFor();
  await page.getByRole("button", { name: "Stop" }).click();
  await page.getByRole("button", { name: "Begin to gather" }).waitFor();
  await page.getByRole("button", { name: /Take the name/ }).first().click();
  await check(page, "gather");
  await page.getByRole("button", { name: "Accept what is named, and learn" }).click();
  await page.getByText("1 landmark accepted and learnt.").waitFor();
  await page.getByRole("button", { name: "Throw everything away" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Throw away" }).click();
  await page.getByText("The gathering is thrown away.").waitFor();
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
  const box = await page.getByRole("application").boundingBox();
  // 1 m to the right of the middle, 1.8 m below it: 20 cm before the lower wall.
  await page.mouse.click(box.x + box.width / 2 + 50, box.y + box.height / 2 + 90);
  await page.getByText(/sign is on the wall/).waitFor();
  const { place } = await api("GET", "/maps/room/landmarks/sign");
  assert.ok(Math.abs(place.y_m + 2) < 1e-9 && Math.abs(place.x_m - 1) < 0.1, JSON.stringify(place));
  assert.ok(Math.abs(place.theta_rad - Math.PI / 2) < 1e-9, "it faces the room");
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForTimeout(500);
  assert.equal((await api("GET", "/maps/room/landmarks/sign")).place.y_m, 2);
  await check(page, "landmark-moved");
});

test("a person tells a robot where it is", async () => {
  const page = await go(`/maps/${MAP}`);
  await page.getByRole("region", { name: "Robots on this map" }).getByText("Live").first().waitFor();
  await page.getByRole("button", { name: "Tell a robot where it is" }).click();
  const robot = await page.getByLabel("Robot", { exact: true }).inputValue();
  const box = await page.getByRole("application").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  await page.getByText("Now click where it looks.").waitFor();
  await page.waitForTimeout(400);
  await page.mouse.click(box.x + box.width / 2 + 60, box.y + box.height / 2);
  await page.getByText(`${robot} is told where it is`).waitFor();
  assert.deepEqual(page.faults, []);
});

test("a robot that knocks is admitted, and its certificates are listed", async () => {
  const robots = (await api("GET", "/robots")).items;
  const name = robots.at(-1).name;
  const page = await go("/robots");
  await page.getByRole("button", { name: `Remove ${name}` }).click();
  await page.getByRole("button", { name: "Remove the robot" }).click();
  await page.getByRole("heading", { name: "Robots that knock" }).waitFor();
  await check(page, "robot-knocks");
  await page.getByRole("button", { name: `Admit ${name}` }).click();
  await page.getByRole("dialog").getByLabel("Map").selectOption(MAP);
  await page.getByRole("button", { name: "Register it" }).click();
  await page.getByRole("link", { name, exact: true }).click();
  await page.getByText(/waymark robot enrol/).waitFor();
  assert.deepEqual(page.faults, []);
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`where landmarks are seen is drawn, and sheets are printed, at the ${where}`, async () => {
    const page = await go(`/maps/${MAP}`, size);
    await page.getByRole("button", { name: "Where landmarks are seen" }).click();
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
    for (const part of ["Where it lies", "Which camera looks", "Best modality", "Walls from scans"]) {
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
  await page.getByRole("button", { name: "Which camera looks" }).click();
  await page.getByLabel("Camera above the floor, m").fill("0.9");
  await page.getByRole("button", { name: "Save", exact: true }).click();
  await page.getByText(/The camera is set/).waitFor();
  assert.equal((await api("GET", "/maps/upstairs/visibility-settings")).camera_height_m, 0.9);
  await page.getByRole("button", { name: "Best modality" }).click();
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

test("a map is saved as a file and loaded under another name", async () => {
  const page = await go(`/maps/${MAP}/settings`);
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Save the map as a file" }).click()]);
  assert.equal(download.suggestedFilename(), `${MAP}.zip`);
  const file = await download.path();
  await page.goto("/");
  await page.getByRole("button", { name: "Load a map from a file" }).click();
  await page.getByRole("dialog").getByLabel("File", { exact: true }).setInputFiles({ name: "map.zip", mimeType: "application/zip", buffer: await readFile(file) });
  await page.getByRole("dialog").getByLabel(/called otherwise/).fill("twin");
  await page.getByRole("button", { name: "Load it" }).click();
  await page.getByRole("heading", { name: "twin", level: 1 }).waitFor();
  const [a, b] = [await api("GET", `/maps/${MAP}`), await api("GET", "/maps/twin")];
  assert.equal(a.landmarks, b.landmarks);
  assert.deepEqual(page.faults, []);
});

test("a camera is calibrated from what it has seen, or it is said what is missing; fixes and a run are shown", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const page = await go(`/robots/${robot}`);
  await page.getByRole("button", { name: /^Calibrate / }).first().click();
  const dialog = page.getByRole("dialog");
  await dialog.getByRole("button", { name: "Calibrate", exact: true }).click();
  await dialog.getByText(/Focal length/).or(dialog.getByRole("alert")).first().waitFor();
  await page.keyboard.press("Escape");
  await page.getByText("What the position rests on").click();
  await page.getByText(/The position rests on:/).waitFor();
  await page.getByRole("button", { name: "Record a run" }).click();
  await page.getByText(/A run is being recorded/).waitFor();
  await page.getByRole("button", { name: "Give the recording up" }).click();
  await page.getByText("The recording is given up.").waitFor();
  await page.getByText(/Error of the position, m/).waitFor();
  // A refused calibration is an answer of 409 or 422, which the browser reports.
  assert.deepEqual(page.faults.filter((fault) => !/409|422|404/.test(fault)), []);
});

test("a viewer sees no button that may not be pressed, and is refused all the same", async () => {
  const { text } = await api("POST", "/tokens", { name: "guest", role: "viewer" });
  const guest = await its.context.browser().newContext({ baseURL: server.origin });
  const page = await open(guest, server.origin, "/");
  await page.getByLabel("Token").fill(text);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("link", { name: MAP, exact: true }).waitFor();
  for (const name of ["New map", "Delete", "Copy", "Rename"]) assert.equal(await page.getByRole("button", { name }).count(), 0, name);
  const refused = await guest.request.fetch(`${server.origin}/api/v1/maps`, { method: "POST", headers: { "x-waymark-page": "1" }, data: { name: "mine" } });
  assert.equal(refused.status(), 403);
  await page.getByRole("button", { name: "Sign out" }).click();
  await page.getByRole("heading", { name: "Sign in to Waymark" }).waitFor();
  // The first answer of a page without a session is 401, which the browser reports.
  assert.deepEqual(page.faults.filter((fault) => !fault.includes("401")), []);
  await guest.close();
});
