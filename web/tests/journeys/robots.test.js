// Journeys about robots, what they were told, and the server, at a desk and on a phone.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, SOON, check, demo, guestOf, journeys, open } from "./harness.js";

const world = journeys({ start: demo });
const { api, go } = world;
/** The name of the demo's map. */
const MAP = "corridor";

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`a robot is shown with its frame and measures, at the ${where}`, async () => {
    const page = await go("/robots", size);
    await page.getByRole("cell", { name: "Live" }).first().waitFor();
    await check(page, `robots-${where}`);
    await page.getByRole("row").nth(1).getByRole("link").first().click();
    await page.getByRole("img", { name: /Last frame/ }).first().waitFor();
    await page.getByText(/Response time, ms: \d/).waitFor();
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
    for (const part of ["Health", "Events", "Jobs", "Users and tokens", "Audit log", "Backups"]) {
      await page.getByRole("button", { name: part }).click();
      await page.getByRole("heading", { name: part }).waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await check(page, `server-${part.toLowerCase().replaceAll(" ", "-")}-${where}`);
    }
  });
}

test("where a lost robot may be is listed, and its uncertainty is plotted", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const page = await go("about:blank");
  // Robots of the demo know where they are: what a lost one is answered is given here.
  let entropy_nats = 5;
  const hypotheses = [{ probability: 0.6, x_m: 1, y_m: 2, theta_rad: 0 }, { probability: 0.3, x_m: 7, y_m: 2, theta_rad: 1.57 }];
  const lost = () => ({ relocalising: true, hypotheses, entropy_nats: (entropy_nats -= 0.5), sightings: 4, landmarks: [], missing: ["higher_probability"], min_probability: 0.9, map: MAP, map_version: 1 });
  await page.route(`**/api/v1/robots/${robot}/relocalisation`, (route) => route.fulfill({ json: lost() }));
  await page.goto(`${world.origin}/robots/${robot}`);
  const places = page.getByRole("region", { name: "Where it may be" });
  await places.getByText("60 %: x 1.00 m, y 2.00 m, faces 0°").waitFor();
  await places.getByText("It is not sure yet: other places are still too probable.").waitFor();
  await page.getByText(/^Uncertainty over the whole map \(entropy\), nats: \d/).waitFor();
  const plot = page.getByRole("img", { name: "Uncertainty over the whole map (entropy), nats over time" });
  await plot.locator("canvas").waitFor();
  const inked = () => plot.locator("canvas").evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let blue = 0;
    for (let i = 0; i < data.length; i += 4) blue += data[i + 2] > 200 && data[i] < 120 && data[i + 3] > 100;
    return blue;
  });
  const until = Date.now() + SOON;
  while ((await inked()) < 20 && Date.now() < until) await page.waitForTimeout(300);
  assert.ok((await inked()) >= 20, "a line is drawn");
  await check(page, "lost-robot");
});

test("what is refused of a robot is said, with what to do", async () => {
  const [robot] = (await api("GET", "/robots")).items;
  const page = await go("about:blank");
  // Robots of the demo are used: one whose scans are refused is given here.
  const reason = { code: "out_of_range", field: "bearing_step_rad", detail: "the fan is more than a turn", advice: "Correct the field.", count: 1200, ago_ms: 300 };
  const inputs = [
    { input: "frame", used: 1500, refused: 0, refused_in_a_row: 0, reasons: [] },
    { input: "scan", used: 0, refused: 1200, refused_in_a_row: 1200, reasons: [reason] },
  ];
  const refused = { ...robot, activity: { ...robot.activity, inputs } };
  await page.route(`**/api/v1/robots/${robot.name}`, (route) => route.fulfill({ json: refused }));
  await page.route(/\/api\/v1\/robots(\?.*)?$/, (route) => route.fulfill({ json: { items: [refused] } }));
  await page.goto(`${world.origin}/robots/${robot.name}`);
  await page.getByRole("alert").getByText("Laser scans: the last 1,200 were refused. Correct the field.").waitFor();
  await page.getByRole("row", { name: /Laser scans out_of_range 1,200 times.*bearing_step_rad: the fan is more than a turn Correct the field\. 0 1,200/ }).waitFor();
  await page.getByRole("row", { name: "Frames 1,500 0" }).waitFor();
  await check(page, "robot-refused");
  await page.goto(`${world.origin}/robots`);
  await page.getByRole("cell", { name: /the fan is more than a turn/ }).waitFor();
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
  const guest = await guestOf(world);
  const page = await open(guest, world.origin, "/");
  await page.getByLabel("Token").fill(text);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("link", { name: MAP, exact: true }).waitFor();
  for (const name of ["New map", "Delete", "Copy", "Rename"]) assert.equal(await page.getByRole("button", { name }).count(), 0, name);
  const refused = await guest.request.fetch(`${world.origin}/api/v1/maps`, { method: "POST", headers: { "x-waymark-page": "1" }, data: { name: "mine" } });
  assert.equal(refused.status(), 403);
  await page.getByRole("button", { name: "Sign out" }).click();
  await page.getByRole("heading", { name: "Sign in to Waymark" }).waitFor();
  // The first answer of a page without a session is 401, which the browser reports.
  assert.deepEqual(page.faults.filter((fault) => !fault.includes("401")), []);
  await guest.close();
});
