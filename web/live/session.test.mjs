// node --test web/session.test.mjs

import assert from "node:assert/strict";
import test from "node:test";
import { api, greeting, signed } from "./session.js";

test("a change carries the page's header, a read does not", () => {
  assert.equal(signed({}).headers, undefined);
  assert.equal(signed({ method: "GET" }).headers, undefined);
  for (const method of ["POST", "put", "PATCH", "DELETE"])
    assert.deepEqual(signed({ method, headers: { accept: "x" } }).headers, { accept: "x", "x-waymark-page": "1" });
});

test("the form says that a link has ended", () => {
  assert.match(greeting("?link=ended"), /used already/);
  assert.match(greeting("?map=hall"), /not signed in/);
});

test("without a session the page is locked and asks no more", async () => {
  const elements = new Map();
  const element = (id) => {
    if (!elements.has(id)) elements.set(id, { hidden: id === "login", focus() {} });
    return elements.get(id);
  };
  globalThis.document = { getElementById: element, querySelector: element };
  globalThis.location = { search: "" };
  let asked = 0;
  globalThis.fetch = async () => { asked += 1; return { status: 401, ok: false }; };
  assert.equal((await api("/maps")).status, 401);
  assert.deepEqual([element("main").hidden, element("login").hidden, element("logout").hidden], [true, false, true]);
  await assert.rejects(api("/maps"), /not signed in/);
  assert.equal(asked, 1);
});
