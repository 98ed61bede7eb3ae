// The last frame of a camera with its quads, drawn and as a table. What the pose known before brought into the frame is
// dashed and says so.

import { answerOf, isByPose, labelOf, named } from "/live/naming.js";

const COLOURS = { unique: "#4ade80", guided: "#38bdf8", ambiguous: "#fbbf24", doubtful: "#fb923c", unknown: "#94a3b8" };
const kindOf = (quad) => (isByPose(quad) ? "guided" : quad.doubtful_landmark ? "doubtful" : quad.verdict);
const colourOf = (quad) => COLOURS[kindOf(quad)] ?? COLOURS.unknown;

export function drawFrame(canvas, picture, answer) {
  canvas.width = picture.width;
  canvas.height = picture.height;
  const c = canvas.getContext("2d");
  c.drawImage(picture, 0, 0);
  const unit = Math.max(1, picture.width / 640);
  c.lineWidth = 2 * unit;
  c.font = `${14 * unit}px system-ui`;
  answer.quads.forEach((quad, index) => {
    c.strokeStyle = colourOf(quad);
    c.setLineDash(isByPose(quad) ? [9 * unit, 5 * unit] : []);
    c.beginPath();
    quad.corners.forEach((p, i) => (i ? c.lineTo(p.u_px + 0.5, p.v_px + 0.5) : c.moveTo(p.u_px + 0.5, p.v_px + 0.5)));
    c.closePath();
    c.stroke();
    const label = labelOf(quad, index);
    const width = c.measureText(label).width + 6 * unit;
    const { u_px, v_px } = quad.corners[0];
    // Corners may lie outside of the picture, a label must not.
    const x = Math.max(Math.min(u_px, picture.width - width), 0);
    const y = Math.min(Math.max(v_px - 4 * unit, 14 * unit), picture.height - 4 * unit);
    c.fillStyle = "rgba(0,0,0,.65)";
    c.fillRect(x, y - 14 * unit, width, 17 * unit);
    c.fillStyle = c.strokeStyle;
    c.fillText(label, x + 3 * unit, y);
  });
}

const PARTS = { agrees: "agrees", disagrees: "shows something else", silent: "says nothing" };

// What the 25 parts of the landmark say, upright as it was taught, with the words beside.
function partsOf(points) {
  if (!points) return "";
  const count = (word) => points.agreement.filter((part) => part === word).length;
  const words = `${points.inliers} of ${points.matches} matches agree, 1e${Math.round(points.log10_false_alarms)} false alarms; ` +
    `parts: ${count("agrees")} agree, ${count("disagrees")} show something else, ${count("silent")} say nothing`;
  const table = document.createElement("span");
  table.className = "parts";
  table.setAttribute("role", "img");
  table.setAttribute("aria-label", words);
  points.agreement.forEach((part, i) => {
    const cell = document.createElement("i");
    cell.className = part;
    cell.title = `row ${Math.floor(i / 5) + 1}, column ${(i % 5) + 1}: ${PARTS[part] ?? part}`;
    table.append(cell);
  });
  const both = document.createElement("span");
  both.className = "points";
  both.append(table, words);
  return both;
}

// One row of cells for each quad.
export function quadCells(answer) {
  return answer.quads.map((quad, index) => {
    const [first, second] = quad.candidates ?? [];
    const isGlobal = named(quad)?.byPose === false;
    const near = (candidate) => (candidate ? `${candidate.landmark} ${candidate.ratio.toFixed(2)}` : "");
    return [index + 1, answerOf(quad), first ? first.ratio.toFixed(2) : "", isGlobal ? quad.confidence.toFixed(2) : "",
      near(isGlobal ? second : first), partsOf(quad.points)];
  });
}
