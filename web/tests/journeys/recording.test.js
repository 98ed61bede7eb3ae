// Journey of a drive that is recorded: the page's command records it, a replay drives it again, and a robot that has stopped
// is told from one that drives.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { statSync } from "node:fs";
import { join } from "node:path";
import { after, test } from "node:test";
import { PHONE, PROGRAM, SOON, check, clean, eventually, hall, journeys, run } from "./harness.js";

let player;
after(() => player?.kill("SIGKILL"));
const world = journeys({
  begin: async () => {
    await run(["demo", "--record", join(world.folder, "drive.mcap"), "--robots", "1", "--legs", "1", "--rate-hz", "1", "--http", "127.0.0.1:0"], { timeout: 4 * SOON });
    await hall(world);
  },
});
const { api, go } = world;
const at = () => ["--server", world.origin, "--zenoh", world.server.robots];

/** Replays the drive as this robot, until it is killed. */
async function replay(robot) {
  player = spawn(PROGRAM, ["replay", join(world.folder, "drive.mcap"), "--robot", robot, "--map", "hall", "--speed", "1", ...at()], { stdio: "ignore", env: clean() });
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
  assert.equal(command, `waymark record recorded.mcap --robot recorded --server ${world.origin}`);
  await world.context.grantPermissions(["clipboard-read", "clipboard-write"], { origin: world.origin });
  await card.getByRole("button", { name: "Copy: The command that records" }).click();
  await page.getByText("The command that records is copied.").waitFor();
  assert.equal(await page.evaluate(() => navigator.clipboard.readText()), command);
  await run([...command.split(" ").slice(1), "--zenoh", world.server.robots, "--seconds", "2"], { cwd: world.folder });
  assert.ok(statSync(join(world.folder, "recorded.mcap")).size > 1000);
  const replayed = await card.getByText(/^waymark replay .* --map hall --server \S+$/).textContent();
  player.kill("SIGKILL");
  const { stdout } = await run([...replayed.split(" ").slice(1), "--zenoh", world.server.robots, "--json"], { cwd: world.folder });
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
    await row.getByText(/position (now|2 s ago)/).waitFor();
    player.kill("SIGKILL");
    await row.getByText("No fresh position", { exact: true }).or(row.getByText("Not connected", { exact: true })).first().waitFor();
    await row.getByText("Not connected", { exact: true }).waitFor();
    await row.getByText(/position ([4-9]|[1-9]\d) s ago/).waitFor();
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
