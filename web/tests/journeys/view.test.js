// Journeys to the view of a map, without robots: turned, zoomed by two fingers, its layers in another order, its floor plan.
import assert from "node:assert/strict";
import { test } from "node:test";
import { PHONE, check, hall, journeys, layPlan, pixels } from "./harness.js";

const world = journeys({
  begin: async () => {
    await hall(world);
  },
});
const { api, go } = world;
const MAP = "hall";
/** Metres in a pixel of the view that the address holds. */
const resolution = (page) => Number(new URL(page.url()).searchParams.get("view")?.split(",")[2]);
/** A white floor plan of 10 m by 6 m about the middle of the map. */
async function plan(page) {
  const png = await page.evaluate(() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 200, height: 120 });
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, 200, 120);
    return canvas.toDataURL("image/png").split(",")[1];
  });
  await layPlan(world, MAP, Buffer.from(png, "base64"), ["-5", "-3"]);
}

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

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`layers are moved up and down by the keyboard, and lie in that order, at the ${where}`, async () => {
    const page = await go("/", size);
    await plan(page);
    await page.goto(`/maps/${MAP}?view=0,0,0.02,0`);
    const canvas = page.locator(".canvas");
    const walls = () => pixels(canvas, [0x39, 0x42, 0x4f]);
    await page.getByText("Layers", { exact: true }).click();
    await page.getByLabel("How opaque: Floor plan").fill("1");
    const rows = async () => (await page.locator(".layers li").allTextContents()).map((text) => text.replace(/[▲▼]/g, "").trim());
    assert.deepEqual((await rows()).at(-1), "Floor plan");
    await page.locator(".layers summary").press("Enter");
    const shown = await walls();
    assert.ok(shown > 300, `${shown} pixels of walls over the plan`);
    await page.locator(".layers summary").press("Enter");
    const up = page.getByRole("button", { name: "Move up: Floor plan" });
    await up.focus();
    for (let i = 0; i < 4; i++) await page.keyboard.press("Enter");
    assert.ok(await up.evaluate((button) => button === document.activeElement), "the focus stays on the button");
    assert.equal((await rows())[0], "Floor plan");
    await page.getByText("Floor plan: number 1 of 5 from the top.").waitFor({ state: "attached" });
    await page.waitForURL(/order=walls\.landmarks\.tracks\.robots\.plan/);
    await check(page, `layers-${where}`);
    await page.locator(".layers summary").press("Enter");
    const hidden = await walls();
    assert.ok(hidden < shown / 10, `${hidden} of ${shown} pixels of walls beneath the plan`);
    const address = page.url();
    await page.goto(address);
    await page.getByText("Layers", { exact: true }).click();
    assert.equal((await rows())[0], "Floor plan", "a sent address has the same order");
    await page.getByRole("button", { name: "Move down: Floor plan" }).press("Enter");
    await page.waitForURL(/order=walls\.landmarks\.tracks\.plan\.robots/);
    assert.deepEqual(page.faults, []);
  });
}

test("what a tool has drawn goes with the tool", async () => {
  const page = await go(`/maps/${MAP}?view=0,0,0.02,0`);
  const canvas = page.getByRole("application");
  const drawn = () => pixels(page.locator(".canvas"), [0x1d, 0x4e, 0xd8]);
  await page.getByRole("button", { name: "Measure" }).click();
  const box = await canvas.boundingBox();
  for (const dx of [-100, 0, 100]) {
    await page.mouse.click(box.x + box.width / 2 + dx, box.y + box.height / 2);
    await page.waitForTimeout(400);
  }
  await page.getByText("Length: 4.00 m").waitFor();
  const shown = await drawn();
  assert.ok(shown > 300, `${shown} pixels of the line`);
  await page.getByRole("button", { name: "Measure" }).click();
  await page.waitForTimeout(300);
  assert.equal(await drawn(), 0);
  assert.deepEqual(page.faults, []);
});

test("two fingers zoom the map on a phone", async () => {
  const page = await go(`/maps/${MAP}?view=0,0,0.02,0`, PHONE);
  const canvas = page.getByRole("application");
  await canvas.waitFor();
  await page.getByRole("heading", { name: MAP, level: 1 }).waitFor();
  await canvas.evaluate((floor) => floor.scrollIntoView({ block: "center" }));
  const box = await canvas.boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const cdp = await world.context.newCDPSession(page);
  await cdp.send("Emulation.setTouchEmulationEnabled", { enabled: true, maxTouchPoints: 2 });
  const scrolled = await page.evaluate(() => scrollY);
  const fingers = (apart) => [{ x: x - apart, y, id: 0 }, { x: x + apart, y, id: 1 }];
  const pinch = async (from, to) => {
    await cdp.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: fingers(from) });
    for (let i = 1; i <= 10; i++) await cdp.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: fingers(from + ((to - from) * i) / 10) });
    await cdp.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
    await page.waitForTimeout(600);
  };
  await pinch(30, 120);
  const near = resolution(page);
  assert.ok(near < 0.008, `from 0.02 to ${near} m in a pixel`);
  await pinch(120, 30);
  const far = resolution(page);
  assert.ok(far > 2 * near, `from ${near} to ${far} m in a pixel`);
  assert.equal(await page.evaluate(() => scrollY), scrolled, "the page itself stays");
  await check(page, "pinch-phone");
});

test("a grid of ROS is laid beneath a map by its two files, and a picture by a line in it", async () => {
  await api("POST", "/maps", { name: "cellar" });
  const page = await go("/maps/cellar");
  await page.getByRole("button", { name: "Floor plan" }).click();
  const grey = Buffer.concat([Buffer.from("P5\n# a cellar\n40 20\n255\n"), Buffer.alloc(800, 254)]);
  const yaml = "image: map.pgm\nresolution: 0.25\norigin:\n  - -5.0\n  - -2.5\n  - 0.0\n";
  await page.getByLabel(/^Picture/).setInputFiles([{ name: "map.yaml", mimeType: "text/yaml", buffer: Buffer.from(yaml) }, { name: "map.pgm", mimeType: "", buffer: grey }]);
  await page.getByRole("img", { name: "The floor plan" }).waitFor();
  await page.getByRole("button", { name: "Save the floor plan" }).click();
  await page.getByText("The floor plan is set.").waitFor();
  const underlay = await api("GET", "/maps/cellar/underlay");
  assert.deepEqual([underlay.place.metres_per_pixel, underlay.place.x_m, underlay.place.y_m, underlay.width_px], [0.25, -5, -2.5, 40]);
  // The form is closed; it is opened once more to measure.
  await page.getByRole("button", { name: "Floor plan" }).click();
  const line = page.getByRole("group", { name: "Measured line" });
  await line.scrollIntoViewIfNeeded();
  const box = await line.boundingBox();
  for (const share of [0.25, 0.75]) await page.mouse.click(box.x + share * box.width, box.y + box.height / 2);
  const px = Number(await page.getByLabel("A length in the picture, pixels").inputValue());
  assert.ok(Math.abs(px - 20) < 0.5, `half of 40 pixels: ${px}`);
  await page.getByLabel("The same length on the floor, metres").fill("4");
  await check(page, "plan-line");
  await page.getByRole("button", { name: "Save the floor plan" }).click();
  await page.getByText("The floor plan is set.").nth(1).waitFor();
  const { place } = await api("GET", "/maps/cellar/underlay");
  assert.ok(Math.abs(place.metres_per_pixel - 4 / px) < 1e-9, JSON.stringify(place));
  await page.getByRole("status").filter({ hasText: "The floor plan is set." }).last().getByRole("button", { name: "Undo" }).click();
  await page.waitForTimeout(500);
  assert.equal((await api("GET", "/maps/cellar/underlay")).place.metres_per_pixel, 0.25);
  assert.deepEqual(page.faults, []);
});
