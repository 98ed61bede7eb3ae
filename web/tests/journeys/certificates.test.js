// Journey of a robot's certificate, on a server that encrypts: it is listed, revoked, and of no use any more.
import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { join } from "node:path";
import { test } from "node:test";
import { promisify } from "node:util";
import { PROGRAM, check, journeys, serve } from "./harness.js";

const world = journeys({ start: (folder) => serve("--tls", "--data", join(folder, "data"), "--zenoh", "tls/127.0.0.1:0") });
const { api, go } = world;

test("a certificate is revoked on the page of its robot", async () => {
  await api("POST", "/maps", { name: "yard" });
  await api("PUT", "/robots/mower", { map: "yard" });
  const page = await go("/robots/mower");
  await page.getByText(/waymark robot enrol mower/).waitFor();
  await promisify(execFile)(PROGRAM, ["robot", "enrol", "mower", "--out", join(world.folder, "mower"), "--server", world.origin]);
  await page.reload();
  const row = page.getByRole("row").filter({ hasText: "valid" });
  await row.waitFor();
  await row.getByRole("button", { name: "Revoke" }).click();
  await page.getByRole("dialog").waitFor();
  await page.keyboard.press("Escape");
  await row.waitFor();
  await row.getByRole("button", { name: "Revoke" }).click();
  await page.getByRole("button", { name: "Revoke it" }).click();
  await page.getByText("The certificate is revoked: whoever uses it is cut off.").waitFor();
  await page.getByRole("row").filter({ hasText: "revoked" }).waitFor();
  assert.equal(await page.getByRole("button", { name: "Revoke" }).count(), 0);
  const [certificate] = (await api("GET", "/robots/mower/certificates")).items;
  assert.ok(certificate.revoked_ms > 0, JSON.stringify(certificate));
  await check(page, "certificate-revoked");
});
