// Journey of a robot's certificate, on a server that encrypts: it is listed, revoked, and of no use any more.
import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { promisify } from "node:util";
import { PROGRAM, asker, browser, check, open, serve } from "./harness.js";

let folder, server, its, api;
before(async () => {
  folder = mkdtempSync(join(tmpdir(), "waymark-certificates-"));
  server = await serve("--tls", "--data", join(folder, "data"), "--zenoh", "tls/127.0.0.1:0");
  its = await browser(server);
  api = asker(its, server);
});
after(async () => {
  await its?.close();
  await server?.stop();
  if (folder) rmSync(folder, { recursive: true, force: true });
});

test("a certificate is revoked on the page of its robot", async () => {
  await api("POST", "/maps", { name: "yard" });
  await api("PUT", "/robots/mower", { map: "yard" });
  const page = await open(its.context, server.origin, "/robots/mower");
  await page.getByText(/waymark robot enrol mower/).waitFor();
  await promisify(execFile)(PROGRAM, ["robot", "enrol", "mower", "--out", join(folder, "mower"), "--server", server.origin]);
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
