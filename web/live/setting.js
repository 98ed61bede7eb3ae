// What an administrator says of a map: where it belongs and lies, and which camera looks for its landmarks. Angles are in
// degrees here and in radians on the wire; what the server refuses is said at its field.

import { api } from "/live/session.js";

const byId = (id) => document.getElementById(id);
const DEG = Math.PI / 180;

// Name on the wire, label, unit, factor from what is shown to the wire.
const WORDS = [["site", "site"], ["building", "building"], ["floor", "floor"]];
const LINK = [["x_m", "x of its origin", "m", 1], ["y_m", "y of its origin", "m", 1],
  ["theta_rad", "rotation", "°", DEG], ["level_m", "height above it", "m", 1]];
const VISIBILITY = [["width_px", "image width", "px", 1], ["height_px", "image height", "px", 1], ["focal_px", "focal length", "px", 1],
  ["camera_height_m", "camera above the floor", "m", 1], ["tilt_low_rad", "lowest tilt", "°", DEG], ["tilt_high_rad", "highest tilt", "°", DEG],
  ["pan_low_rad", "rightmost pan", "°", DEG], ["pan_high_rad", "leftmost pan", "°", DEG],
  ["max_incidence_rad", "most oblique view", "°", DEG], ["min_side_px", "shortest side seen", "px", 1],
  ["max_fill", "largest share of the image", "%", 0.01], ["standoff_m", "landmark before its wall", "cm", 0.01]];
let map = null;
// By path: the ETag of what its form shows. A change is meant for that.
const seen = {};
// By what was read: its ETag.
const tags = new WeakMap();
// Where the map lies, as the form shows it.
let shownPlace = null;
const placeOf = (found) => JSON.stringify([found.name, found.site, found.building, found.floor, found.parent]);

async function ask(method, path, body) {
  const options = { method, headers: { accept: "application/json" } };
  if (body !== undefined) Object.assign(options, { body: JSON.stringify(body), headers: { ...options.headers, "content-type": "application/json" } });
  if (method !== "GET") options.headers["if-match"] = seen[path] ?? "*";
  const answer = await api(path, options);
  const found = await answer.json().catch(() => ({}));
  if (!answer.ok) throw Object.assign(new Error(found.detail ?? `${answer.status}`), { field: found.field, code: found.code });
  tags.set(found, answer.headers.get("etag"));
  if (method !== "GET") seen[path] = tags.get(found);
  return found;
}

const place = () => `/maps/${encodeURIComponent(map)}`;

// A labelled input with room for what is wrong with it.
function field(name, label, unit) {
  const row = document.createElement("label");
  row.className = "setting";
  row.append(Object.assign(document.createElement("span"), { textContent: label }));
  const input = Object.assign(document.createElement("input"), { name, autocomplete: "off" });
  if (unit) Object.assign(input, { type: "number", step: "any" });
  const wrong = Object.assign(document.createElement("em"), { className: "wrong", id: `wrong-${name}` });
  wrong.setAttribute("role", "alert");
  input.setAttribute("aria-describedby", wrong.id);
  row.append(input, Object.assign(document.createElement("span"), { className: "facts", textContent: unit ?? "" }), wrong);
  return row;
}

function clean(form) {
  form.querySelectorAll(".wrong").forEach((e) => { e.textContent = ""; });
  form.querySelectorAll("[aria-invalid]").forEach((e) => e.removeAttribute("aria-invalid"));
  form.querySelector("[role=status]").textContent = "";
}

function refuse(form, name, text) {
  const input = form.elements[name];
  if (!input) { form.querySelector("[role=status]").textContent = text; return; }
  input.setAttribute("aria-invalid", "true");
  byId(`wrong-${name}`).textContent = text;
  input.focus();
}

// The server's text speaks of radians where people see degrees: the bound is shown in their unit.
const inUnit = (text, unit) => (unit === "°" ? text.replace(/(-?\d+(\.\d+)?(e-?\d+)?)(?= is out| $|$)/g, (n) => `${(n / DEG).toFixed(1)}°`).replaceAll("_rad", "") : text);

// Numbers as the wire has them. Of fields left empty: nothing; a wrong one is refused here.
function numbers(form, fields) {
  const made = {};
  for (const [name, label, unit, factor] of fields) {
    const input = form.elements[name];
    if (input.validity.badInput) throw Object.assign(new Error(`${label}: a number`), { field: name });
    if (input.value.trim() !== "") made[name] = Number((Number(input.value) * factor).toPrecision(12));
  }
  return made;
}

function show(form, fields, values) {
  for (const [name, , , factor] of fields) {
    const value = values?.[name];
    form.elements[name].value = value === undefined || value === null ? "" : Number((value / factor).toPrecision(7));
  }
}

async function send(form, fields, work) {
  clean(form);
  const button = form.querySelector("button");
  button.disabled = true;
  try {
    await work();
    form.querySelector("[role=status]").textContent = "Saved.";
    window.dispatchEvent(new CustomEvent("maps-changed"));
  } catch (error) {
    if (error.code === "changed_meanwhile") return faster(form);
    const name = (error.field ?? "").replace(/^parent\./, "");
    const of = fields.find(([n]) => n === name);
    refuse(form, name === "map" ? "parent" : name, inUnit(error.message, of?.[2]));
  } finally { button.disabled = false; }
}

// Somebody else has changed what this form shows.
function faster(form) {
  const again = Object.assign(document.createElement("button"), { type: "button", textContent: "Show what is there now" });
  again.addEventListener("click", () => { clean(form); load(map, true).catch((error) => refuse(form, "", error.message)); });
  form.querySelector("[role=status]").replaceChildren("Not saved: somebody else was faster. ", again);
}

function saveWhere(event) {
  event.preventDefault();
  const form = event.target;
  send(form, LINK, async () => {
    const changes = Object.fromEntries(WORDS.map(([name]) => [name, form.elements[name].value.trim() || null]));
    const parent = form.elements.parent.value;
    const link = numbers(form, LINK);
    const missing = parent && LINK.slice(0, 3).find(([name]) => link[name] === undefined);
    if (missing) throw Object.assign(new Error("needed with another map"), { field: missing[0] });
    const kept = parent && form.dataset.parent === parent && form.dataset.covariance ? { covariance: JSON.parse(form.dataset.covariance) } : {};
    changes.parent = parent ? { map: parent, ...link, ...kept } : null;
    shownPlace = placeOf(await ask("PATCH", place(), changes));
  });
}

function saveVisibility(event) {
  event.preventDefault();
  const form = event.target;
  send(form, VISIBILITY, async () => show(form, VISIBILITY, await ask("PUT", `${place()}/visibility-settings`, numbers(form, VISIBILITY))));
}

function toggleLink(form) {
  for (const [name] of LINK) form.elements[name].disabled = !form.elements.parent.value;
}

async function load(name, isWanted = false) {
  map = name;
  const [found, settings, maps] = await Promise.all([ask("GET", place()), ask("GET", `${place()}/visibility-settings`), ask("GET", "/maps?limit=500")]);
  if (map !== name) return;
  const form = byId("where-form");
  // Others may have changed what is in the map; the form still shows where it lies.
  if (shownPlace === placeOf(found)) seen[place()] = tags.get(found);
  // What somebody is typing stays.
  if (!isWanted && (form.contains(document.activeElement) || byId("visibility-form").contains(document.activeElement))) return;
  shownPlace = placeOf(found);
  seen[place()] = tags.get(found);
  seen[`${place()}/visibility-settings`] = tags.get(settings);
  for (const [word] of WORDS) form.elements[word].value = found[word] ?? "";
  const others = maps.items.filter((m) => m.name !== name).map((m) => new Option([m.building, m.floor, m.name].filter(Boolean).join(" / "), m.name));
  form.elements.parent.replaceChildren(new Option("none: it stands for itself", ""), ...others);
  form.elements.parent.value = found.parent?.map ?? "";
  form.dataset.parent = found.parent?.map ?? "";
  form.dataset.covariance = found.parent?.covariance ? JSON.stringify(found.parent.covariance) : "";
  show(form, LINK, found.parent);
  toggleLink(form);
  show(byId("visibility-form"), VISIBILITY, settings);
}

function build() {
  const where = byId("where-form"), settings = byId("visibility-form");
  const parent = field("parent", "lies in the map");
  const choice = Object.assign(document.createElement("select"), { name: "parent" });
  choice.setAttribute("aria-describedby", "wrong-parent");
  parent.querySelector("input").replaceWith(choice);
  byId("where-fields").append(...WORDS.map(([name, label]) => field(name, label)), parent, ...LINK.map(([name, label, unit]) => field(name, label, unit)));
  byId("visibility-fields").append(...VISIBILITY.map(([name, label, unit]) => field(name, label, unit)));
  choice.addEventListener("change", () => toggleLink(where));
  where.addEventListener("submit", saveWhere);
  settings.addEventListener("submit", saveVisibility);
  byId("visibility-defaults").addEventListener("click", () => send(settings, VISIBILITY, async () => show(settings, VISIBILITY, await ask("PUT", `${place()}/visibility-settings`, {}))));
  window.addEventListener("map-loaded", (event) => load(event.detail.map).catch((error) => {
    where.querySelector("[role=status]").textContent = `The server does not answer as expected (${error.message}).`;
  }));
}

build();
