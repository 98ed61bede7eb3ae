// Which modality is best where, as runs have shown: a layer of the map, and the choice of what is fused.
// A square metre has four triangles, one for each heading in which it was driven through.

import { api } from "/live/session.js";

const byId = (id) => document.getElementById(id);
// `tag`: the ETag of what is shown; a change is meant for that.
const known = { map: null, areas: null, tag: null, changed: () => {} };

const shown = () => document.querySelector("[data-layer=modalities]").checked;

async function asked(path, options) {
  const answer = await api(path, { headers: { "content-type": "application/json" }, ...options });
  const body = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(body.detail ?? body.title), { code: body.code });
  known.tag = answer.headers.get("etag");
  return body;
}

function tell() {
  const { areas } = known;
  byId("modality-bar").hidden = !shown();
  if (!areas) return;
  byId("fusion").value = areas.fusion_mode;
  const judged = areas.cells.filter((cell) => cell.best).length;
  byId("modality-hint").textContent = areas.cells.length
    ? `${areas.cells.length} squares and headings driven through, ${judged} often enough to be judged.`
    : "No run has been learnt from. Record one with `waymark run start ROBOT`, then give its reference trajectory with `waymark run learn ROBOT FILE`.";
}

// Reads what is known of a map, if the layer is shown.
export async function loadModalities(map, changed) {
  Object.assign(known, { map, changed });
  known.areas = shown() ? await asked(`/maps/${encodeURIComponent(map)}/modalities`).catch(() => null) : null;
  tell();
  changed();
}

export function drawModalities(c, px, ink) {
  if (!known.areas || !shown()) return;
  const side = known.areas.cell_m;
  const colours = { odometry: ink.odometry, laser: ink.laser, landmarks: ink.landmark };
  for (const cell of known.areas.cells) {
    const [x, y] = [cell.x_m + side / 2, cell.y_m + side / 2];
    const [dx, dy] = [Math.cos(cell.heading_rad) * side / 2, Math.sin(cell.heading_rad) * side / 2];
    c.fillStyle = colours[cell.best] ?? ink.faint;
    c.globalAlpha = cell.best ? 0.55 : 0.15;
    c.beginPath();
    // The side that the robot drives towards, seen from the middle.
    for (const [u, v] of [[x, y], [x + dx - dy, y + dy + dx], [x + dx + dy, y + dy - dx]]) c.lineTo(...px(u, v));
    c.closePath();
    c.fill();
  }
  c.globalAlpha = 1;
  c.strokeStyle = ink.faint;
  c.lineWidth = 1.5;
  c.font = "12px system-ui";
  for (const area of known.areas.areas) {
    c.beginPath();
    for (const [x, y] of area.corners_m) c.lineTo(...px(x, y));
    c.closePath();
    c.stroke();
    const [x, y] = area.corners_m[0];
    const [u, v] = px(x, y);
    c.fillStyle = ink.faint;
    c.fillText(area.name, u + 4, v - 4);
  }
}

// Somebody else has changed what is shown.
function faster() {
  const again = Object.assign(document.createElement("button"), { type: "button", textContent: "Show what is there now" });
  again.addEventListener("click", () => loadModalities(known.map, known.changed));
  byId("modality-hint").replaceChildren("Not changed: somebody else was faster. ", again);
}

byId("fusion").addEventListener("change", async (event) => {
  const body = JSON.stringify({ fusion_mode: event.target.value });
  const headers = { "content-type": "application/json", "if-match": known.tag ?? "*" };
  try {
    known.areas = await asked(`/maps/${encodeURIComponent(known.map)}/modalities`, { method: "PUT", headers, body });
    tell();
  } catch (error) {
    byId("modality-hint").textContent = `Not changed: ${error.message}.`;
    if (error.code === "changed_meanwhile") faster();
  }
  known.changed();
});
byId("layers").addEventListener("change", (event) => {
  if (event.target.dataset.layer === "modalities" && known.map) loadModalities(known.map, known.changed);
});
