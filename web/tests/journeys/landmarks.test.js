// Journeys of landmarks: found, taught, gathered, changed, drafted; why a robot was told what it was told; and every page in
// dark and light.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, check, demo, eventually, journeys } from "./harness.js";

const world = journeys({ start: demo });
const { api, go } = world;
const MAP = "corridor";
const landmarksOf = async () => (await api("GET", `/maps/${MAP}/landmarks`)).items;

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
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
    await page.getByText("Details: how well it is told apart").click();
    await page.getByRole("img", { name: /Hausdorff/ }).waitFor();
    await page.getByRole("img", { name: /Photograph \d+/ }).first().waitFor();
    await check(page, `landmark-${where}`);
  });
}

test("a landmark is renamed, measured, taken out of use and brought back by undo", async () => {
  const [first] = (await api("GET", `/maps/${MAP}/landmarks`)).items;
  const page = await go(`/maps/${MAP}/landmarks/${first.name}`);
  await page.getByRole("button", { name: "Size" }).click();
  // A width that the photographs do not contradict.
  const width = (1.03 * first.size.width_m).toFixed(2);
  await page.getByLabel("Width, metres").fill(width);
  await page.getByRole("button", { name: "Save" }).click();
  await page.getByText(`${width} m wide`).waitFor();
  await page.getByRole("button", { name: "Undo" }).click();
  await page.getByText(`${first.size.width_m.toFixed(2)} m wide`).waitFor();
  await page.getByRole("button", { name: "Take out of use" }).click();
  await page.getByText("Out of use", { exact: true }).first().waitFor();
  await page.getByRole("button", { name: "Put back in use" }).click();
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
  await page.getByText("Details: how well it is told apart").click();
  await page.getByRole("img", { name: /Points .*named/ }).waitFor();
  await page.getByRole("button", { name: "Merge" }).click();
  await page.getByLabel("The other one").selectOption("twin");
  await check(page, "landmark-merge");
  await page.getByRole("dialog").getByRole("button", { name: "Merge" }).click();
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
  const frame = await world.context.request.get(`${world.origin}/api/v1/robots/${robot.name}/cameras/${camera}/frame`);
  const file = { name: "frame.jpg", mimeType: frame.headers()["content-type"], buffer: await frame.body() };
  const page = await go("/maps/school/teach");
  await page.locator("input[type=file]").first().setInputFiles(file);
  await page.getByRole("button", { name: "Set the corners myself" }).click();
  const corner = page.getByRole("slider", { name: "Corner, top left" });
  await corner.focus();
  await page.keyboard.press("Shift+ArrowLeft");
  await page.getByLabel("Name").fill("window");
  // As wide as the corners say that are there at first.
  await page.getByLabel("Width, metres").fill("1.2");
  await page.getByLabel("Height, metres").fill("0.9");
  await check(page, "teach");
  await page.getByRole("button", { name: "Add the photograph" }).click();
  await page.getByRole("button", { name: "Learn window" }).click();
  await page.getByText(/window is learnt/).waitFor();
  await page.getByLabel("Photograph to try").setInputFiles(file);
  await page.getByRole("list", { name: "Outlines" }).getByRole("listitem").first().waitFor();
  assert.deepEqual(page.faults, []);
  const landmark = await api("GET", "/maps/school/landmarks/window");
  assert.equal(landmark.views, 1);
  assert.equal(landmark.size.width_m, 1.2);
});

test("candidates appear while a robot drives, and are named, accepted or thrown away", async () => {
  const page = await go("/robots");
  await page.getByRole("cell", { name: "Live" }).first().waitFor();
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  await page.goto(`/maps/${MAP}/gather`);
  await page.getByLabel("Robot").selectOption(robot);
  await page.getByLabel("also further views of known landmarks").check();
  await page.getByRole("button", { name: "Begin to collect" }).click();
  await page.getByRole("article", { name: /Candidate \d+/ }).first().waitFor();
  await page.getByRole("button", { name: "Stop" }).click();
  await page.getByRole("button", { name: "Begin to collect" }).waitFor();
  await page.getByRole("button", { name: /Take the name/ }).first().click();
  await check(page, "gather");
  await page.getByRole("button", { name: "Accept what is named, and learn" }).click();
  await page.getByText("1 landmark accepted and learnt.").waitFor();
  await page.getByRole("button", { name: "Throw everything away" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Throw away" }).click();
  await page.getByText("What was collected is thrown away.").waitFor();
  assert.deepEqual(page.faults, []);
});

/** A stored answer with a pose before the frame and by the frame, and with points that agree. */
const answer = () =>
  eventually("stored answer with all that it rests on", async () => {
    for (const { id } of (await api("GET", "/answers?status=matched&limit=20")).items) {
      const found = await api("GET", `/answers/${id}`);
      const quad = found.quads.find(({ icon, matched }) => icon && matched?.matches.some(({ agrees }) => agrees));
      if (found.prior_check?.seen && quad) return { id, found, quad };
    }
  });

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`an answer is opened with both positions, the gate and the matched points, at the ${where}`, async () => {
    const { id, found, quad } = await answer();
    const page = await go(`/answers/${id}`, size);
    await page.getByRole("img", { name: /The floor with before the frame, as the server had it; by the picture alone/ }).waitFor();
    const gate = page.getByText(/the position by the picture and .* are \d+\.\d sigma apart/i);
    await gate.waitFor();
    assert.ok((await gate.textContent()).includes(`are ${Math.sqrt(found.prior_check.distance2).toFixed(1)} sigma apart`), await gate.textContent());
    const { landmark, matches } = quad.matched;
    const agreeing = matches.filter(({ agrees }) => agrees).length;
    const drawing = page.getByRole("img", { name: `Points of the outline joined with points of ${landmark}: ${agreeing} of ${matches.length} agree` }).first();
    await drawing.waitFor();
    assert.equal(await drawing.locator("line").count(), matches.length);
    assert.equal(await drawing.locator(".agrees line").count(), agreeing);
    await drawing.scrollIntoViewIfNeeded();
    await check(page, `answer-evidence-${where}`);
  });
}

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`when a landmark was recognised is shown by hour, at the ${where}`, async () => {
    const { found } = await answer();
    const name = found.summary.landmarks[0] ?? (await landmarksOf())[0].name;
    const page = await go(`/maps/${MAP}/landmarks/${name}`, size);
    await page.getByText("Details: how well it is told apart").click();
    const drawing = page.getByRole("img", { name: new RegExp(`^Stored answers of the last 24 hours by hour: [1-9]\\d* name ${name}, \\d+ have seen it unconfirmed`) });
    await drawing.waitFor();
    assert.equal(await drawing.locator("rect.named").count(), 24);
    const heights = await drawing.locator("rect.named").evaluateAll((bars) => bars.map((bar) => Number(bar.getAttribute("height"))));
    assert.ok(heights.at(-1) + heights.at(-2) > 0 && heights.slice(0, 20).every((height) => height === 0), heights.join());
    await drawing.scrollIntoViewIfNeeded();
    await page.getByRole("link", { name: "Show them" }).click();
    await page.waitForURL(new RegExp(`landmark=${name}`));
    await check(page, `by-hour-${where}`);
  });
}

test("candidates say what view is missing, and what to do", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const { id } = await api("POST", `/maps/${MAP}/gatherings`, { robot, landmark: null, known: true });
  const page = await go(`/maps/${MAP}/gather`);
  const tracks = async () => (await api("GET", `/maps/${MAP}/gatherings/${id}/tracks`)).tracks;
  await eventually("candidate that is not good enough", async () => (await tracks()).some(({ passes, failed_gates }) => !passes && failed_gates.length));
  await page.getByRole("button", { name: "Stop" }).click();
  await page.getByRole("button", { name: "Begin to collect" }).waitFor();
  const track = (await tracks()).find(({ passes, failed_gates }) => !passes && failed_gates.length);
  const card = page.getByRole("article", { name: `Candidate ${track.number}`, exact: true });
  for (const { sentence, advice } of track.failed_gates) await card.getByText(`${sentence} ${advice}`).waitFor();
  await check(page, "candidate-advice");
  await api("DELETE", `/maps/${MAP}/gatherings/${id}`);
});

test("a gathering is thrown away only after a question", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const page = await go(`/maps/${MAP}/gather`);
  await page.getByLabel("Robot").selectOption(robot);
  await page.getByRole("button", { name: "Begin to collect" }).click();
  await page.getByRole("button", { name: "Stop" }).click();
  await page.getByRole("button", { name: "Throw everything away" }).click();
  await page.keyboard.press("Escape");
  await page.getByRole("dialog").waitFor({ state: "detached" });
  assert.equal((await api("GET", `/maps/${MAP}/gatherings`)).items.length, 1, "nothing is lost without an answer");
  await page.getByRole("button", { name: "Throw everything away" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Throw away" }).click();
  await page.getByText("What was collected is thrown away.").waitFor();
  assert.equal((await api("GET", `/maps/${MAP}/gatherings`)).items.length, 0);
});

test("every page is readable in dark and in light", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const [{ name: landmark }] = await landmarksOf();
  const { id } = await answer();
  const pages = ["/", `/maps/${MAP}`, `/maps/${MAP}/landmarks`, `/maps/${MAP}/landmarks/${landmark}`, `/maps/${MAP}/teach`, `/maps/${MAP}/gather`,
    `/maps/${MAP}/history`, `/maps/${MAP}/settings`, `/maps/${MAP}/sheet`, "/robots", `/robots/${robot}`, "/answers", `/answers/${id}`, "/admin"];
  for (const colorScheme of ["dark", "light"]) {
    for (const address of pages) {
      const page = await go("about:blank");
      await page.emulateMedia({ colorScheme });
      await page.goto(`${world.origin}${address}`);
      await page.getByRole("heading", { level: 1 }).first().waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await check(page, `${colorScheme}${address.replace(String(id), "one").replace(robot, "one").replace(landmark, "one").replaceAll("/", "-")}`);
      await page.close();
    }
  }
});
