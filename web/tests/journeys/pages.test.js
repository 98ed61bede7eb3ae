// Journeys of an administrator through the pages of a running server, at a desk and on a phone.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { PHONE, browser, check, demo, open } from "./harness.js";

let server, its;
before(async () => {
  server = await demo();
  its = await browser(server);
});
after(async () => {
  await its?.close();
  await server?.stop();
});

const go = (address, size) => open(its.context, server.origin, address, size);
/** The name of the demo's map. */
const MAP = "corridor";
const api = async (method, path, body, headers = {}) => {
  const answer = await its.context.request.fetch(`${server.origin}/api/v1${path}`, {
    method,
    headers: { "x-waymark-page": "1", ...headers },
    ...(body && { data: body }),
  });
  assert.ok(answer.ok(), `${method} ${path}: ${answer.status()} ${await answer.text()}`);
  return answer.status() === 204 ? undefined : answer.json();
};

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
    await page.getByRole("heading", { name: "Photographs" }).waitFor();
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
