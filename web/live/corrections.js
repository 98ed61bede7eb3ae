// The log of corrections of one robot: every fix, whether the picture, the pose or the laser gave it, and what became of it.
// Hears from app.js which map is shown; asks only while the panel is open.

import { correctionCells, totalsText } from "/live/naming.js";
import { api } from "/live/session.js";

const POLL_MS = 2000;
const SHOWN = 40;
const byId = (id) => document.getElementById(id);
const panel = byId("corrections-panel");
let map = null;

async function asked(path) {
  const answer = await api(path, { headers: { accept: "application/json" } });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.json();
}

async function robots() {
  const choice = byId("corrections-robot"), chosen = choice.value;
  const names = (await asked("/robots?limit=100")).items.filter((robot) => robot.map === map).map((robot) => robot.name);
  if (names.join() === [...choice.options].map((o) => o.value).join()) return;
  choice.replaceChildren(...names.map((name) => new Option(name, name)));
  if (names.includes(chosen)) choice.value = chosen;
}

function tr(cells, kind) {
  const row = document.createElement("tr");
  row.className = kind;
  for (const cell of cells) row.insertCell().append(cell);
  return row;
}

async function refresh() {
  if (!panel.open || map === null) return;
  await robots();
  const robot = byId("corrections-robot").value;
  const log = robot ? await asked(`/robots/${encodeURIComponent(robot)}/corrections`) : { totals: {}, corrections: [] };
  const newest = Math.max(...log.corrections.map((c) => c.captured_ns));
  const latest = log.corrections.slice(-SHOWN).reverse();
  byId("corrections").replaceChildren(...latest.map((c) => tr(correctionCells(c, newest), `fix-${c.modality}`)));
  byId("corrections-facts").textContent = totalsText(log.totals) || "No fix has come yet.";
}

const update = () => refresh().catch((error) => {
  byId("corrections-facts").textContent = `The server does not answer as expected (${error.message}).`;
});
panel.addEventListener("toggle", update);
byId("corrections-robot").addEventListener("change", update);
window.addEventListener("map-loaded", (event) => { map = event.detail.map; update(); });
setInterval(update, POLL_MS);
