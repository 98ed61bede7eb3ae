// Journeys on the first page and to a first robot: a checklist on an empty server, maps and fleet at a glance, what needs
// somebody, and how a new robot is connected.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, check, hall, journeys } from "./harness.js";

const world = journeys();
const { api, go } = world;

test("an empty server leads step by step to the first position", async () => {
  const page = await go("/");
  await page.getByRole("heading", { name: "From here to the first position: 0 of 7 done" }).waitFor();
  await check(page, "start-empty");
  await page.getByRole("button", { name: "Make the first map" }).click();
  await page.getByRole("dialog").getByLabel("Name").fill("hall");
  await page.getByRole("button", { name: "Create" }).click();
  await page.getByRole("heading", { name: "hall", level: 1 }).waitFor();
  await page.goto(world.origin);
  await page.getByText("1 of 7 done").waitFor();
  await page.getByRole("link", { name: "Do it" }).click();
  await page.getByRole("button", { name: "Floor plan" }).waitFor();
  await api("DELETE", "/maps/hall", undefined, { "if-match": "*" });
  await hall(world);
  // Walls without a plan need none, and the landmark is learnt and placed.
  await page.goto(world.origin);
  await page.getByText("5 of 7 done").waitFor();
  const next = page.getByRole("listitem").filter({ has: page.getByRole("link", { name: "Do it" }) });
  assert.match(await next.textContent(), /Register a robot, and connect it/);
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`the first page shows floors, the fleet, and what needs somebody with the button that helps, at the ${where}`, async () => {
    if (where === "desk") {
      await api("POST", "/maps", { name: "attic" });
      await api("PUT", "/robots/mower", { map: "hall" });
      await api("PATCH", "/maps/hall/landmarks/poster", { health: "quarantined" }, { "if-match": "*" });
    }
    const page = await go("/", size);
    const floor = page.getByRole("article").filter({ hasText: "hall" }).locator("svg");
    await floor.waitFor();
    assert.equal(await floor.locator("circle.bad").count(), 1, "the landmark that is out of use is red");
    assert.ok((await floor.locator("path").getAttribute("d")).includes("M-4 -2L4 -2"), "its walls are drawn");
    const robots = page.getByRole("region", { name: "Robots" });
    await robots.getByText("0 of 1").first().waitFor();
    const needs = page.getByRole("region", { name: "Needs attention" });
    await needs.getByText("1 landmark of hall: out of use.").waitFor();
    await check(page, `needs-attention-${where}`);
    await needs.getByRole("link", { name: /Look: 1 landmark of hall/ }).click();
    await page.waitForURL(/maps\/hall\?.*state=quarantined/);
    const list = page.getByRole("region", { name: "Landmarks", exact: true });
    await list.getByRole("button", { name: "poster" }).waitFor();
  });
}

test("what is mended needs nobody any more", async () => {
  const page = await go("/");
  await page.getByText("1 landmark of hall: out of use.").waitFor();
  await api("PATCH", "/maps/hall/landmarks/poster", { health: "sound" }, { "if-match": "*" });
  await page.getByText("Nothing: the server is ready, no message is refused, and every landmark is in use.").waitFor();
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`a new robot is told how to connect, and a light says when its messages come, at the ${where}`, async () => {
    const name = `rover-${where}`;
    const page = await go("/robots", size);
    await page.getByRole("button", { name: "Register a robot" }).click();
    await page.getByRole("dialog").getByLabel("Name").fill(name);
    await page.getByRole("dialog").getByLabel("Map").selectOption("hall");
    await page.getByRole("button", { name: "Save", exact: true }).click();
    const guide = page.getByRole("region", { name: `Connect ${name}` });
    await guide.getByText("Waiting for its first message.").waitFor();
    await guide.getByLabel("The server's address for robots").fill("tcp/10.0.0.5:7447");
    await guide.getByText(`Robot.connect("${name}", endpoint="tcp/10.0.0.5:7447")`).waitFor();
    await guide.getByRole("button", { name: "Rust" }).click();
    await guide.getByText(`RobotOptions::new("tcp/10.0.0.5:7447", "default", "${name}")`).waitFor();
    await guide.getByRole("button", { name: "ROS 2" }).click();
    await guide.getByText(`robot = "${name}"`).waitFor();
    await guide.getByLabel("The server's address for robots").fill("tls/maps.example:7447");
    await guide.getByText(`waymark robot enrol ${name} --out ${name}`).waitFor();
    await check(page, `connect-${where}`);
    // No robot drives here: what the server says of one is given here.
    const [robot] = (await api("GET", "/robots")).items.filter((one) => one.name === name);
    const input = (used, reasons) => ({ input: "frame", used, refused: reasons.length, refused_in_a_row: reasons.length, reasons });
    const activity = (used, reasons) => ({ last_message_ms: 300, frames_per_s: 1, answered: used, inputs: [input(used, reasons)] });
    let told = { ...robot, alive: true };
    await page.route(`**/api/v1/robots/${name}`, (route) => route.fulfill({ json: told }));
    await guide.getByText("It is connected, and has sent nothing yet.").waitFor();
    told = { ...robot, alive: true, activity: activity(0, [{ code: "out_of_range", field: "jpeg", detail: "the picture cannot be read", advice: "Send JPEG.", count: 1, ago_ms: 100 }]) };
    await guide.getByText("Its messages come, and are refused: the picture cannot be read. Send JPEG.").waitFor();
    told = { ...robot, alive: true, activity: activity(1, []) };
    await guide.getByText("Connected: its messages are used.").waitFor();
    const green = await guide.locator(".light span").evaluate((light) => getComputedStyle(light).backgroundColor);
    assert.match(green, /rgb\(22, 101, 52\)|rgb\(74, 222, 128\)/, green);
  });
}
