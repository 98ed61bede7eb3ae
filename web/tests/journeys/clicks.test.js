// Clicks every link, tab and button of every page, each on the page as it was opened, and fails where nothing comes of it: no
// other address, no other words, no dialog, no file, nothing sent. A tab has to change more than the heading. A dialog that
// opens is left by Cancel.
import assert from "node:assert/strict";
import { test } from "node:test";
import { eventually, hall, journeys, open } from "./harness.js";

const world = journeys({
  begin: async () => {
    await hall(world);
    await api("POST", "/maps/hall/landmarks", { name: "bare" });
    await api("PUT", "/robots/mower", { map: "hall" });
    await api("POST", "/maps/hall/drafts", { name: "plan-b" });
    await api("POST", "/tokens", { name: "guest", role: "viewer" });
    await api("POST", "/backups");
    await eventually("backup", async () => (await api("GET", "/backups")).items.some(({ state }) => state === "complete"));
  },
});
const { api } = world;

/** What can be clicked. The page and the tab that one is on, and what is out of sight until it has the focus, lead nowhere. */
const CLICKABLE = "a[href]:not([aria-current='page'], .skip), button:not(:disabled, [aria-disabled='true'], [aria-label='Parts'] [aria-pressed='true']), summary, [role='button']";
/** Ends the session of the whole test. Other journeys press it. */
const NOT_HERE = ["Sign out"];
/** Time for something to come of a click, ms. */
const LATEST_MS = 15_000;

const ADDRESSES = [
  "/",
  "/maps/hall?view=3,1,0.02,0.3",
  "/maps/hall?view=3,1,0.02,0.3&landmark=poster",
  "/maps/hall/landmarks",
  "/maps/hall/landmarks?as=table",
  "/maps/hall/landmarks/poster",
  "/maps/hall/landmarks/poster/sheet",
  "/maps/hall/sheet",
  "/maps/hall/teach?landmark=poster",
  "/maps/hall/gather",
  "/maps/hall/history",
  "/maps/hall/drafts/plan-b?view=3,1,0.02,0.3",
  ...["where", "camera", "fusion", "scans"].map((part) => `/maps/hall/settings?view=3,1,0.02,0.3&part=${part}`),
  "/robots",
  "/robots/mower",
  "/answers",
  "/help",
  "/help/first-pose",
  ...["health", "events", "jobs", "tokens", "audit", "backups"].map((part) => `/admin?part=${part}`),
];

/** A page that is as it was this long ago is drawn, ms. */
const STILL_MS = 400;

/** Waits until the page is drawn and nothing of it changes: a click while it is drawn anew reaches nothing. Ages count up. */
async function settled(page) {
  await page.getByRole("heading", { level: 1 }).first().waitFor();
  await page.waitForFunction((still_ms) => {
    const words = document.body.innerHTML.replace(/\d+/g, "0");
    if (words !== globalThis.words_before) [globalThis.words_before, globalThis.words_since] = [words, performance.now()];
    return !document.querySelector(".loading") && performance.now() - globalThis.words_since > still_ms;
  }, STILL_MS);
}

/** What can be clicked on the page, by the name and the place among those of the same name. */
const clickable = (page, frame) => page.locator(CLICKABLE).evaluateAll((all, frame) => {
  const seen = new Map();
  const shown = all.filter((one) => one.checkVisibility() && !one.closest("dialog") && (frame || one.closest("main")));
  return shown.map((one) => {
    const name = (one.getAttribute("aria-label") ?? one.textContent).trim().replace(/\s+/g, " ");
    const key = `${one.tagName} ${name}`;
    seen.set(key, (seen.get(key) ?? 0) + 1);
    one.dataset.click = `${key} ${seen.get(key)}`;
    return { key: one.dataset.click, name, is_tab: one.closest("[aria-label='Parts']") !== null };
  });
}, frame);

/** What a person would notice: the address, the words, what is pressed or open. Ages count up by themselves. */
const state = (page, is_tab) => page.evaluate((is_tab) => {
  const main = document.querySelector("main").cloneNode(true);
  // Of a tab the heading and the tabs themselves do not count.
  if (is_tab) for (const part of main.querySelectorAll("h1, h2, [aria-label='Parts']")) part.remove();
  const words = (is_tab ? main : document.body).innerHTML.replace(/ data-click="[^"]*"/g, "").replace(/\d+/g, "0").replace(/<!--.*?-->/g, "");
  return (is_tab ? "" : location.href + (document.body.dataset.printed ?? "")) + words;
}, is_tab);

/** Clicks one, and says whether something came of it. */
async function comesOf(page, { key, is_tab }) {
  const before = await state(page, is_tab);
  let happened = false;
  const note = () => (happened = true);
  const sent = (request) => {
    const own = /\/whoami$|\/live$|\/events|\/readyz$|\/version$|\/servers$|\/robots$|\/cameras$|\/relocalisation$/.test(new URL(request.url()).pathname);
    happened ||= !is_tab && (request.method() !== "GET" || request.isNavigationRequest() || (request.resourceType() === "fetch" && !own));
  };
  for (const event of ["download", "filechooser"]) page.once(event, note);
  // Another tab; "popup" is not told of one without an opener.
  page.context().once("page", note);
  page.on("request", sent);
  await page.locator(`[data-click="${key.replaceAll('"', '\\"')}"]`).click();
  const until = Date.now() + LATEST_MS;
  while (!happened && Date.now() < until) {
    // `||=` would write over what an event has noted meanwhile.
    if (await state(page, is_tab).then((now) => now !== before, () => true)) happened = true;
    if (!happened) await page.waitForTimeout(100);
  }
  page.off("request", sent);
  for (const event of ["download", "filechooser"]) page.off(event, note);
  page.context().off("page", note);
  return happened;
}

for (const address of ADDRESSES) {
  test(`something comes of every click on ${address.replace(/\?view[^&]*&?/, "?")}`, async () => {
    const page = await open(world.context, world.origin, "about:blank");
    // No paper comes of it here.
    await page.addInitScript(() => (globalThis.print = () => (document.body.dataset.printed = "yes")));
    await page.goto(`${world.origin}${address}`);
    await settled(page);
    // What is above every page is clicked on the first ones.
    const has_frame = address === "/" || address === "/maps/hall?view=3,1,0.02,0.3";
    const all = (await clickable(page, has_frame)).filter(({ name }) => !NOT_HERE.includes(name));
    assert.ok(all.length > 0 || ["/answers", "/maps/hall/gather"].includes(address), `${all.length} to click`);
    const dead = [];
    let gone = 0;
    for (const one of all) {
      if (one !== all[0]) {
        await page.goto(`${world.origin}${address}`);
        await settled(page);
        // An earlier click may have taken it away, such as the one that takes a landmark out of use.
        if (!(await clickable(page, has_frame)).some(({ key }) => key === one.key)) {
          gone += 1;
          continue;
        }
      }
      if (!(await comesOf(page, one))) dead.push(one.key);
      const cancel = page.getByRole("dialog").getByRole("button", { name: "Cancel" });
      if (await cancel.isVisible().catch(() => false)) {
        await cancel.click();
        await cancel.waitFor({ state: "detached" });
      }
      for (const other of world.context.pages()) if (other !== page) await other.close();
    }
    assert.deepEqual(dead, [], "nothing comes of these");
    assert.ok(gone <= 3, `${gone} of ${all.length} were gone`);
    await page.close();
  });
}
