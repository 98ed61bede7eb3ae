// Journey of a drive that is recorded: the page's command records it, a replay drives it again, and a robot that has stopped
// is told from one that drives.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { PHONE, PROGRAM, SOON, asker, browser, check, clean, eventually, hall, open, run, serve } from "./harness.js";

let folder, server, its, api, player;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "waymark-recording-"));
  await run(["demo", "--record", join(folder, "drive.mcap"), "--robots", "1", "--legs", "1", "--rate-hz", "1", "--http", "127.0.0.1:0"], { timeout: 4 * SOON });
  server = await serve("--data", join(folder, "data"), "--zenoh", "tcp/127.0.0.1:0");
  its = await browser(server);
  api = asker(its, server);
  await hall(its, server, api);
});
after(async () => {
  player?.kill("SIGKILL");
  await its?.close();
  await server?.stop();
  if (folder) rmSync(folder, { recursive: true, force: true });
});
afterEach(() => Promise.all(its.context.pages().map((page) => page.close())));

const go = (address, size) => open(its.context, server.origin, address, size);
const at = () => ["--server", server.origin, "--zenoh", server.robots];

/** Replays the drive as this robot, until it is killed. */
async function replay(robot) {
  player = spawn(PROGRAM, ["replay", join(folder, "drive.mcap"), "--robot", robot, "--map", "hall", "--speed", "1", ...at()], { stdio: "ignore", env: clean() });
  await eventually("robot that replays", async () => (await api("GET", "/robots")).items.some(({ name, activity }) => name === robot && activity));
  // It has a pose once a person has told it one: on this map it recognises nothing.
  await eventually("pose", async () => {
    await api("PUT", `/robots/${robot}/pose`, { x_m: 0, y_m: 0, theta_rad: 0 });
    return (await api("GET", `/robots/${robot}`)).pose;
  });
}

test("the page's commands record a drive as MCAP, and can be copied", async () => {
  await replay("recorded");
  const page = await go("/robots/recorded");
  const card = page.getByRole("region", { name: "Record and replay a drive" });
  const command = await card.getByText(/^waymark record /).textContent();
  assert.equal(command, `waymark record recorded.mcap --robot recorded --server ${server.origin}`);
  await its.context.grantPermissions(["clipboard-read", "clipboard-write"], { origin: server.origin });
  await card.getByRole("button", { name: "Copy: The command that records" }).click();
  await page.getByText("The command that records is copied.").waitFor();
  assert.equal(await page.evaluate(() => navigator.clipboard.readText()), command);
  await run([...command.split(" ").slice(1), "--zenoh", server.robots, "--seconds", "2"], { cwd: folder });
  assert.ok(statSync(join(folder, "recorded.mcap")).size > 1000);
  const replayed = await card.getByText(/^waymark replay .* --map hall --server \S+$/).textContent();
  player.kill("SIGKILL");
  const { stdout } = await run([...replayed.split(" ").slice(1), "--zenoh", server.robots, "--json"], { cwd: folder });
  assert.ok(JSON.parse(stdout), stdout);
  assert.ok((await api("GET", "/robots")).items.some(({ name }) => name === "replay"));
  await check(page, "record-robot");
});

for (const [size, where] of [[undefined, "desk"], [PHONE, "phone"]]) {
  test(`a robot that has stopped is told from one that drives, at the ${where}`, async () => {
    const robot = `ghost-${where}`;
    await replay(robot);
    const page = await go("/maps/hall", size);
    const row = page.getByRole("region", { name: "Robots on this map" }).getByRole("listitem").filter({ hasText: robot });
    await row.getByText("Live", { exact: true }).waitFor();
    await row.getByText(/pose (now|2 s ago)/).waitFor();
    player.kill("SIGKILL");
    await row.getByText("No fresh pose", { exact: true }).or(row.getByText("Not connected", { exact: true })).first().waitFor();
    await row.getByText("Not connected", { exact: true }).waitFor();
    await row.getByText(/pose ([4-9]|[1-9]\d) s ago/).waitFor();
    await check(page, `stale-robot-${where}`);
    await page.goto("/robots");
    const cells = page.getByRole("row").filter({ hasText: robot });
    await cells.getByText("Not connected").waitFor();
    await cells.getByRole("cell", { name: /^(Last seen )?\d+ (s|min) ago$/ }).first().waitFor();
    // A page that is opened after the robot has stopped does not show it alive.
    await page.goto("/maps/hall");
    await row.getByText("Not connected", { exact: true }).waitFor();
    await row.getByText(/last seen \d+ (s|min) ago/).waitFor();
    assert.deepEqual(page.faults, []);
  });
}
