// Journeys to the reasons: why a robot was told what it was told; and every page in dark and light.
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

}

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
