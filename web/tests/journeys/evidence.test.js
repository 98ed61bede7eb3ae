// Journeys to the reasons: why a robot was told what it was told, why a photograph was refused, how a landmark is brought back,
// and what every page says when it is empty or broken, in dark and light, of long names.
import assert from "node:assert/strict";
import { after, afterEach, before, test } from "node:test";
import { PHONE, asker, browser, check, demo, eventually, open } from "./harness.js";

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
afterEach(() => Promise.all(its.context.pages().map((page) => page.close())));

const go = (address, size) => open(its.context, server.origin, address, size);
const MAP = "corridor";
const landmarksOf = async () => (await api("GET", `/maps/${MAP}/landmarks`)).items;

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
    const gate = page.getByText(/the position by the picture lies \d+\.\d standard deviations/i);
    await gate.waitFor();
    assert.ok((await gate.textContent()).includes(`distance ${found.prior_check.distance2.toFixed(1)})`), await gate.textContent());
    const { landmark, matches } = quad.matched;
    const agreeing = matches.filter(({ agrees }) => agrees).length;
    const drawing = page.getByRole("img", { name: `Points of the quad joined with points of ${landmark}: ${agreeing} of ${matches.length} agree` }).first();
    await drawing.waitFor();
    assert.equal(await drawing.locator("line").count(), matches.length);
    assert.equal(await drawing.locator(".agrees line").count(), agreeing);
    await drawing.scrollIntoViewIfNeeded();
    await check(page, `answer-evidence-${where}`);
  });

  test(`photographs that were refused are shown with the reason, at the ${where}`, async () => {
    const [{ name }] = await landmarksOf();
    const at = `/api/v1/maps/${MAP}/landmarks/${name}/views`;
    const upload = (buffer, more = {}) =>
      its.context.request.post(`${server.origin}${at}`, {
        headers: { "x-waymark-page": "1" },
        multipart: { image: { name: "photo.png", mimeType: "image/png", buffer }, ...more },
      });
    const page = await go(`/maps/${MAP}/landmarks/${name}`, size);
    const refused = page.getByRole("region", { name: "Photographs that were refused" });
    if (where === "desk") await refused.getByText("None: every photograph was taken").waitFor();
    assert.equal((await upload(Buffer.from("no picture"), { whole_image: "true" })).status(), 422);
    const blank = Buffer.from(
      await page.evaluate(() => {
        const canvas = Object.assign(document.createElement("canvas"), { width: 320, height: 200 });
        canvas.getContext("2d").fillRect(0, 0, 320, 200);
        return canvas.toDataURL("image/png").split(",")[1];
      }),
      "base64",
    );
    assert.equal((await upload(blank)).status(), 422);
    const [view] = (await api("GET", `/maps/${MAP}/landmarks/${name}/views`)).items;
    const photograph = await (await its.context.request.get(`${server.origin}${at}/${view.id}/image`)).body();
    assert.equal((await upload(photograph, { corners: JSON.stringify(view.corners) })).status(), 200);
    await page.reload();
    await refused.getByText(`It is photograph ${view.id} once more. Choose another photograph.`).first().waitFor();
    await refused.getByText("No four edges were found in it.").first().waitFor();
    await refused.getByText("It is neither a JPEG nor a PNG picture.").first().waitFor();
    const pictures = refused.getByRole("img", { name: "What was refused" });
    await pictures.first().scrollIntoViewIfNeeded();
    await page.waitForFunction(() => [...document.querySelectorAll("img[alt='What was refused']")].slice(0, 2).every((image) => image.naturalWidth > 20));
    await check(page, `refused-${where}`);
  });
}

test("a landmark is deleted and brought back by the history", async () => {
  const name = (await landmarksOf()).at(-1).name;
  const page = await go(`/maps/${MAP}/landmarks/${name}`);
  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await page.getByRole("button", { name: "Delete the landmark" }).click();
  await page.waitForURL(/history/);
  assert.ok(!(await landmarksOf()).some((one) => one.name === name));
  await page.getByRole("button", { name: /Undo change/ }).first().click();
  await page.getByRole("button", { name: "Undo it" }).click();
  await eventually("landmark again", async () => (await landmarksOf()).some((one) => one.name === name && one.status === "active"));
  assert.deepEqual(page.faults, []);
});

test("a token is made for a person, used, and revoked", async () => {
  const page = await go("/admin?part=tokens");
  await page.getByRole("button", { name: "Users and tokens" }).click();
  await page.getByRole("button", { name: "New token" }).click();
  await page.getByLabel("Name, of a person or a program").fill("anna");
  await page.getByLabel("Role").selectOption("teacher");
  await page.getByRole("dialog").getByLabel(MAP, { exact: true }).check();
  await page.getByRole("button", { name: "Make it" }).click();
  const text = (await page.getByRole("status").locator("code").textContent()).trim();
  const anna = await its.context.browser().newContext({ baseURL: server.origin });
  const hers = await open(anna, server.origin, "/");
  await hers.getByLabel("Token").fill(text);
  await hers.getByRole("button", { name: "Sign in" }).click();
  await hers.getByText("anna · teacher").waitFor();
  assert.equal(await hers.getByRole("link", { name: "Server" }).count(), 0, "a teacher has no page of the server");
  await page.getByRole("button", { name: "Revoke anna" }).click();
  await page.getByRole("button", { name: "Revoke it" }).click();
  await page.getByRole("row", { name: /anna/ }).getByText("revoked").waitFor();
  await hers.reload();
  await hers.getByRole("heading", { name: "Sign in to Waymark" }).waitFor();
  assert.deepEqual(page.faults, []);
  await anna.close();
});

test("a gathering is thrown away only after a question", async () => {
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const page = await go(`/maps/${MAP}/gather`);
  await page.getByLabel("Robot").selectOption(robot);
  await page.getByRole("button", { name: "Begin to gather" }).click();
  await page.getByRole("button", { name: "Stop" }).click();
  await page.getByRole("button", { name: "Throw everything away" }).click();
  await page.keyboard.press("Escape");
  await page.getByRole("dialog").waitFor({ state: "detached" });
  assert.equal((await api("GET", `/maps/${MAP}/gatherings`)).items.length, 1, "nothing is lost without an answer");
  await page.getByRole("button", { name: "Throw everything away" }).click();
  await page.getByRole("dialog").getByRole("button", { name: "Throw away" }).click();
  await page.getByText("The gathering is thrown away.").waitFor();
  assert.equal((await api("GET", `/maps/${MAP}/gatherings`)).items.length, 0);
});

test("a map is turned, its layers fade, and the view is in the address", async () => {
  const page = await go(`/maps/${MAP}`);
  await page.getByRole("button", { name: "Turn left" }).click();
  await page.waitForURL(/view=[^&]*%2C0\.262|view=[^&]*,0\.262/);
  await page.getByText("Layers", { exact: true }).click();
  await page.getByLabel("How opaque: Walls").fill("0.3");
  await page.getByLabel("Walls", { exact: true }).uncheck();
  await page.waitForURL(/off=/);
  const address = page.url();
  await page.goto(address);
  await page.getByText("Layers", { exact: true }).click();
  assert.ok(!(await page.getByLabel("Walls", { exact: true }).isChecked()), "a sent address has the same layers");
  assert.ok(/0\.262/.test(page.url()), page.url());
  assert.deepEqual(page.faults, []);
});

/** Every page, with what makes it empty or not there. */
const LONG = `a${"-very-long-name".repeat(4)}`.slice(0, 64);

test("empty pages say so, and have the button that helps", async () => {
  await api("POST", "/maps", { name: LONG, site: "A site with a long name of its own", building: "House of many floors and doors" });
  for (const [address, words, button] of [
    [`/maps/${LONG}`, /There is no landmark on this map yet/, /Teach the first one/],
    [`/maps/${LONG}/landmarks`, /no landmark/i, /Teach|Photograph|photograph/],
    [`/maps/${LONG}/gather`, /gather/i, /Begin to gather/],
    [`/answers?map=${LONG}`, /No stored answer is like that/, undefined],
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
  await page.getByRole("link", { name: "Answers" }).click();
  await page.getByRole("alert").first().waitFor();
  await page.unroute("**/api/v1/answers**");
  await page.getByRole("button", { name: /again/i }).first().click();
  await page.getByRole("cell").first().waitFor();
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
      await page.goto(`${server.origin}${address}`);
      await page.getByRole("heading", { level: 1 }).first().waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await check(page, `${colorScheme}${address.replace(String(id), "one").replace(robot, "one").replace(landmark, "one").replaceAll("/", "-")}`);
      await page.close();
    }
  }
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
  const [{ name: robot }] = (await api("GET", "/robots")).items;
  const [{ name: landmark }] = await landmarksOf();
  const { text } = await api("POST", "/tokens", { name: "looker", role: "viewer" });
  const guest = await its.context.browser().newContext({ baseURL: server.origin });
  const page = await open(guest, server.origin, "/");
  await page.getByLabel("Token").fill(text);
  await page.getByRole("button", { name: "Sign in" }).click();
  await page.getByRole("link", { name: MAP, exact: true }).waitFor();
  const changes = /new|delete|remove|rename|copy|save|learn|begin|publish|undo|go back|admit|revoke|calibrate|record|merge|size|take out|move|upload|accept|throw|tell a robot|floor plan|add /i;
  for (const address of ["/", `/maps/${MAP}`, `/maps/${MAP}/landmarks`, `/maps/${MAP}/landmarks/${landmark}`, `/maps/${MAP}/history`, `/maps/${MAP}/settings`, "/robots", `/robots/${robot}`, "/answers"]) {
    await page.goto(address);
    await page.getByRole("heading", { level: 1 }).first().waitFor();
    await page.waitForFunction(() => !document.querySelector(".loading"));
    const buttons = await page.getByRole("button").evaluateAll((all) => all.filter((one) => !one.disabled).map((one) => one.getAttribute("aria-label") ?? one.textContent.trim()));
    assert.deepEqual(buttons.filter((name) => changes.test(name)), [], address);
  }
  await guest.close();
});
