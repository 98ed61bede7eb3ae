// The panel for views gathered while a robot drives: turn it on, watch the counts, look at the tracks, accept or throw
// away. Hears from app.js which map is shown; talks to `maps/{map}/gatherings`.

import { api } from "/live/session.js";

const API = "/api/v1";
const POLL_MS = 2000;

const byId = (id) => document.getElementById(id);
const state = { map: null, gathering: null, tracks: [], busy: false };

async function ask(method, path, body) {
  const init = { method, headers: { accept: "application/json" } };
  if (body !== undefined) {
    init.headers["content-type"] = "application/json";
    init.body = JSON.stringify(body);
  }
  const answer = await api(path, init);
  const value = answer.status === 204 ? null : await answer.json();
  if (!answer.ok) throw new Error(value?.detail ?? `${path}: ${answer.status}`);
  return value;
}

const home = () => `/maps/${encodeURIComponent(state.map)}/gatherings`;
const here = () => `${home()}/${state.gathering.id}`;

// Runs what a button asks for, one at a time, and shows what went wrong.
async function act(work) {
  if (state.busy) return;
  state.busy = true;
  byId("gather-hint").textContent = "";
  try { await work(); } catch (error) { byId("gather-hint").textContent = error.message; } finally { state.busy = false; }
}

function options(select, values, first) {
  const chosen = select.value;
  select.replaceChildren(...(first === undefined ? [] : [new Option(first, "")]), ...values.map((v) => new Option(v, v)));
  if ([...select.options].some((o) => o.value === chosen)) select.value = chosen;
}

async function open(map, landmarks) {
  if (state.map !== map) {
    Object.assign(state, { map, gathering: null, tracks: [] });
    list();
  }
  options(byId("gather-landmark"), landmarks.filter((l) => l.status === "active").map((l) => l.name), "whatever is new");
  const robots = (await ask("GET", "/robots?limit=100")).items.filter((r) => r.map === map).map((r) => r.name);
  options(byId("gather-robot"), robots);
  const all = (await ask("GET", `${home()}?limit=100`)).items;
  const shown = state.gathering && all.find((g) => g.id === state.gathering.id);
  state.gathering = shown ?? all.find((g) => g.open) ?? all.at(-1) ?? null;
  if (state.gathering && !state.tracks.length) await look();
  show();
}

async function look() {
  state.tracks = (await ask("GET", `${here()}/tracks`)).tracks;
  list();
  show();
}

async function refresh() {
  if (!state.gathering?.open || document.hidden) return;
  state.gathering = await ask("GET", here());
  show();
}

const degrees = (rad) => `${Math.round((rad * 180) / Math.PI)}°`;

function show() {
  const g = state.gathering;
  byId("gather-start").disabled = !byId("gather-robot").value;
  for (const id of ["gather-stop", "gather-look", "gather-accept", "gather-drop"]) byId(id).disabled = !g;
  byId("gather-stop").disabled = !g?.open;
  byId("gather-accept").disabled = !state.tracks.length;
  if (!g) {
    byId("gather-facts").textContent = "Nothing has been gathered on this map.";
  } else {
    const c = g.counts;
    byId("gather-facts").textContent = `${g.open ? "gathering" : "ended"}: ${g.robot}, ${g.landmark ?? (g.known ? "whatever is new and what it recognises" : "whatever is new")}; ` +
      `${c.frames} frames (${c.dropped} dropped), ${c.kept} views kept, ${c.near_duplicate} like one that is kept, ${c.known_landmark} known or nearly`;
  }
}

// Only when they were asked for anew: names that are being typed stay.
function list() {
  byId("gather-table").hidden = !state.tracks.length;
  byId("tracks").replaceChildren(...state.tracks.map(rowOf));
}

function rowOf(track) {
  const tr = document.createElement("tr");
  const cell = (content) => tr.insertCell().append(content);
  const picture = new Image(75, 75);
  picture.alt = `track ${track.number}`;
  if (track.best_view !== null) picture.src = `${API}${here()}/tracks/${track.number}/views/${track.best_view}/icon`;
  cell(picture);
  cell(`${track.views.length} of ${track.sightings}${track.inconsistent_views ? `, ${track.inconsistent_views} left out` : ""}`);
  const place = track.place;
  cell(place ? `${degrees(place.angle_rad[0])} to ${degrees(place.angle_rad[1])}` : "unknown");
  cell(track.side_px.map((s) => s.toFixed(0)).join(" to ") + " px");
  cell(place ? `${place.x_m.toFixed(2)}, ${place.y_m.toFixed(2)} m; ${place.width_m.toFixed(2)} x ${place.height_m.toFixed(2)} m` : track.not_placed);
  const verdict = document.createElement("span");
  verdict.textContent = track.passes ? "passes" : track.failed_gates.map((g) => `${g.sentence} ${g.advice}`).join(" ");
  verdict.className = "reasons";
  cell(verdict);
  const name = document.createElement("input");
  name.size = 14;
  name.maxLength = 64;
  name.placeholder = "name";
  name.dataset.track = track.number;
  name.setAttribute("aria-label", `name of track ${track.number}`);
  if (track.landmark) Object.assign(name, { value: track.landmark, readOnly: true });
  cell(name);
  const drop = document.createElement("button");
  drop.type = "button";
  drop.textContent = "Throw away";
  drop.addEventListener("click", () => act(async () => {
    await ask("DELETE", `${here()}/tracks/${track.number}`);
    await look();
  }));
  cell(drop);
  return tr;
}

async function accept() {
  const named = [...byId("tracks").querySelectorAll("input")].filter((i) => i.value.trim());
  if (!named.length) throw new Error("Name at least one track.");
  const picks = named.map((i) => (i.readOnly ? { track: Number(i.dataset.track) } : { track: Number(i.dataset.track), name: i.value.trim() }));
  const accepted = await ask("POST", `${here()}/accept`, { tracks: picks });
  await look();
  let job = accepted.job;
  while (job && (job.state === "queued" || job.state === "running")) {
    byId("gather-hint").textContent = `learning: ${Math.round(100 * job.progress)} %, ${job.message}`;
    await new Promise((done) => setTimeout(done, 300));
    job = await ask("GET", `/jobs/${job.id}`);
  }
  byId("gather-hint").textContent = job ? `${job.state}: ${job.message}` : "";
}

window.addEventListener("map-loaded", (e) => act(() => open(e.detail.map, e.detail.landmarks)));
byId("gather-start").addEventListener("click", () => act(async () => {
  const landmark = byId("gather-landmark").value || null;
  state.gathering = await ask("POST", home(), { robot: byId("gather-robot").value, landmark, known: byId("gather-known").checked });
  state.tracks = [];
  list();
  show();
}));
byId("gather-stop").addEventListener("click", () => act(async () => {
  state.gathering = await ask("POST", `${here()}/stop`);
  await look();
}));
byId("gather-look").addEventListener("click", () => act(look));
byId("gather-accept").addEventListener("click", () => act(accept));
byId("gather-drop").addEventListener("click", () => act(async () => {
  const count = state.tracks.length;
  if (!confirm(`Throw away this gathering with ${count} ${count === 1 ? "track" : "tracks"}? It cannot be restored.`)) return;
  await ask("DELETE", here());
  Object.assign(state, { gathering: null, tracks: [] });
  list();
  show();
}));
setInterval(() => { refresh().catch(() => {}); }, POLL_MS);
