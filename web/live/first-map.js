// What a server without maps and a map without walls offer: to make a map, and to lay a floor plan under it.

import { api } from "/live/session.js";

const byId = (id) => document.getElementById(id);

async function send(method, path, body) {
  const headers = { accept: "application/json", "if-match": "*" };
  if (typeof body === "string") headers["content-type"] = "application/json";
  const answer = await api(path, { method, headers, body });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).detail ?? `${answer.status}`);
}

// Sends a form; what the server refuses is said below it.
function submits(form, request, then) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const said = form.querySelector("[role=alert]"), button = form.querySelector("button");
    button.disabled = true;
    said.textContent = "";
    try {
      await request(form);
      then(form);
    } catch (error) {
      said.textContent = error.message;
    }
    button.disabled = false;
  });
}

let map = null;

// Shows what is missing: a map, or the floor plan of this one. `null`: there is no map.
export function offer(name, isBare) {
  map = name;
  byId("create-map").hidden = name !== null;
  byId("import-plan").hidden = name === null || !isBare;
}

export function wireUp(changed) {
  submits(byId("create-map"), (form) => send("POST", "/maps", JSON.stringify({ name: form.elements.name.value })),
    (form) => changed(form.elements.name.value));
  submits(byId("import-plan"), (form) => {
    const parts = new FormData();
    parts.append("metres_per_pixel", form.elements.metres_per_pixel.value);
    parts.append("image", form.elements.image.files[0]);
    return send("PUT", `/maps/${encodeURIComponent(map)}/underlay`, parts);
  }, () => changed(map));
}
