// Every page, at a desk and on a phone, as it is with robots that drive: what holds on every page, its picture for
// docs/guides/administrator.md, and its help.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, check, demo, eventually, journeys } from "./harness.js";

const MAP = "corridor";
const world = journeys({
  start: demo,
  begin: async () => {
    const seen = await eventually("answer with a pose", async () => (await api("GET", "/answers?status=matched&limit=1")).items[0]);
    const [{ name: robot }] = (await api("GET", "/robots")).items;
    const [landmark] = seen.landmarks;
    Object.assign(world, { robot, landmark, answer: seen.id });
    await api("POST", `/maps/${MAP}/drafts`, { name: "spring" });
    await api("POST", "/maps/spring/landmarks", { name: "new-door" });
    await api("POST", "/tokens", { name: "night-shift", role: "viewer" });
    await api("POST", "/backups");
  },
});
const { api, go } = world;
const ready = (words) => (page) => page.getByText(words).filter({ visible: true }).first().waitFor();

/** The name of its picture, its pattern in `src/words/help.ts`, its address, and what makes it ready. */
const PAGES = [
  ["start", "/", () => "/", ready("6 landmarks")],
  ["map", "/maps/:map", () => `/maps/${MAP}`, ready("Live")],
  ["landmarks", "/maps/:map/landmarks", () => `/maps/${MAP}/landmarks`, ready("In use")],
  ["landmark", "/maps/:map/landmarks/:landmark", () => `/maps/${MAP}/landmarks/${world.landmark}`, ready("In use")],
  ["landmark-sheet", "/maps/:map/landmarks/:landmark/sheet", () => `/maps/${MAP}/landmarks/${world.landmark}/sheet`, drawn],
  ["floor-sheet", "/maps/:map/sheet", () => `/maps/${MAP}/sheet`, drawn],
  ["settings-where", "/maps/:map/settings?part=where", () => `/maps/${MAP}/settings?part=where`],
  ["settings-camera", "/maps/:map/settings?part=camera", () => `/maps/${MAP}/settings?part=camera`],
  ["settings-gates", "/maps/:map/settings?part=gates", () => `/maps/${MAP}/settings?part=gates`],
  ["settings-fusion", "/maps/:map/settings?part=fusion", () => `/maps/${MAP}/settings?part=fusion`],
  ["settings-scans", "/maps/:map/settings?part=scans", () => `/maps/${MAP}/settings?part=scans`],
  ["teach", "/maps/:map/teach", () => `/maps/${MAP}/teach`, outlined],
  ["gather", "/maps/:map/gather", () => `/maps/${MAP}/gather`, gathered],
  ["history", "/maps/:map/history", () => `/maps/${MAP}/history`],
  ["draft", "/maps/:map/drafts/:draft", () => `/maps/${MAP}/drafts/spring`, ready("1 landmark added")],
  ["robots", "/robots", () => "/robots", ready("Live")],
  ["robot", "/robots/:robot", () => `/robots/${world.robot}`, (page) => page.getByRole("img", { name: /Last frame/ }).first().waitFor()],
  ["answers", "/answers", () => "/answers?status=matched", ready("recognised")],
  ["answer", "/answers/:answer", () => `/answers/${world.answer}`, (page) => page.getByRole("img", { name: "What the robot saw, upright" }).first().waitFor()],
  ["health", "/admin?part=health", () => "/admin?part=health", ready("Ready")],
  ["events", "/admin?part=events", () => "/admin?part=events"],
  ["jobs", "/admin?part=jobs", () => "/admin?part=jobs"],
  ["tokens", "/admin?part=tokens", () => "/admin?part=tokens", ready("night-shift")],
  ["audit", "/admin?part=audit", () => "/admin?part=audit"],
  ["backups", "/admin?part=backups", () => "/admin?part=backups"],
  ["guides", "/help", () => "/help"],
  ["guide", "/help/:guide", () => "/help/first-pose", ready("What you should see")],
];

function drawn(page) {
  return page.getByRole("img", { name: "The floor from above" }).waitFor();
}

/** Chooses the last frame of a robot, in which outlines are found. */
async function outlined(page) {
  const camera = (await api("GET", `/robots/${world.robot}/cameras`)).cameras[0].name;
  const frame = await world.context.request.get(`${world.origin}/api/v1/robots/${world.robot}/cameras/${camera}/frame`);
  await page.locator("input[type=file]").first().setInputFiles({ name: "frame.jpg", mimeType: frame.headers()["content-type"], buffer: await frame.body() });
  await page.getByRole("button", { name: "Set the corners myself" }).waitFor();
}

/** Gathers until there is a candidate. At the second size they are there. */
async function gathered(page) {
  const candidate = page.getByRole("article", { name: /Candidate \d+/ }).first();
  const begin = page.getByRole("button", { name: "Begin to collect" });
  await candidate.or(begin).first().waitFor();
  if (await begin.isVisible() && !(await candidate.isVisible())) {
    await page.getByLabel("Robot").selectOption(world.robot);
    await page.getByLabel("also further views of known landmarks").check();
    await begin.click();
    await candidate.waitFor();
    await page.getByRole("button", { name: "Stop" }).click();
    await begin.waitFor();
  }
}

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  for (const [name, , address, until] of PAGES) {
    test(`the page ${name} is as every page is, at the ${where}`, async () => {
      const page = await go(address(), size);
      await page.getByRole("heading", { level: 1 }).first().waitFor();
      await page.waitForFunction(() => !document.querySelector(".loading"));
      await until?.(page);
      await page.evaluate(() => document.fonts.ready);
      await check(page, `${name}-${where}`);
    });
  }
}

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`each page says what it is for, and leads to its place in a guide, at the ${where}`, async () => {
    const said = new Set();
    for (const [name, , address] of PAGES) {
      const page = await go(address(), size);
      await page.getByRole("button", { name: "Help", exact: true }).click();
      const help = page.getByRole("region", { name: "Help on this page" });
      const sentence = await help.locator("p").first().textContent();
      assert.ok(/^[A-Z].{15,}\.$/.test(sentence) && !said.has(sentence), `${name}: ${sentence}`);
      said.add(sentence);
      if (where === "phone") {
        const box = await help.boundingBox();
        assert.ok(box.x >= 0 && box.x + box.width <= PHONE.width, `${name}: the help is at ${JSON.stringify(box)}`);
      }
      if (name === "map") await check(page, `help-${where}`);
      await help.getByRole("link", { name: /^Guide: / }).click();
      await page.waitForURL(/\/help\//);
      assert.ok(!(await help.isVisible()), "the help is closed");
      const { hash } = new URL(page.url());
      const heading = page.locator(hash ? `article ${hash}` : "article h1");
      await heading.waitFor();
      await eventually(`sight of ${hash || "the guide"} of ${name}`, () => heading.evaluate((one) => one.getBoundingClientRect().top >= 0 && one.getBoundingClientRect().top < innerHeight));
      const words = await heading.evaluate((one) => {
        let next = one.nextElementSibling;
        while (next && !next.textContent.trim()) next = next.nextElementSibling;
        return next.textContent;
      });
      assert.match(words, /[A-Z][^.]{20,}\./, `${name}: ${words}`);
      assert.equal(await page.locator("article img").count(), 0, "no picture that is not served");
      assert.deepEqual(page.faults, []);
      await page.close();
    }
  });
}

test("links between guides lead to the guides, to the place in them, and back", async () => {
  const page = await go("/help");
  await page.getByRole("link", { name: "Troubleshooting" }).click();
  await page.getByRole("heading", { name: "Troubleshooting", level: 1 }).waitFor();
  const inside = page.getByRole("navigation", { name: "Sections" }).getByRole("link", { name: "The robot gets no pose" });
  await inside.click();
  await page.waitForURL(/#the-robot-gets-no-pose$/);
  await eventually("section", () => page.getByRole("heading", { name: "The robot gets no pose" }).evaluate((one) => Math.abs(one.getBoundingClientRect().top) < 40));
  await page.goBack();
  await page.waitForURL(/troubleshooting$/);
  const links = await page.locator("article a").evaluateAll((all) => all.map((link) => link.getAttribute("href")));
  assert.ok(links.length > 3, `${links.length} links`);
  for (const link of links) {
    assert.match(link, /^(#|\/help\/[\w-]+(#|$))/, link);
    const [, name] = /^\/help\/([\w-]+)/.exec(link) ?? [];
    if (name) assert.equal((await world.context.request.get(`${world.origin}/guides/${name}.md`)).status(), 200, name);
  }
});
