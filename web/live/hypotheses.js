// Places where a robot may be that sees only things which look like several landmarks: read from the answers to its frames,
// drawn as ellipses whose strength is their probability.

const CHI2_2_95 = 5.991; // 95 % of a two-dimensional Gaussian
const FAINTEST = 0.12;
const WORDS = {
  higher_probability: "other places are still too probable",
  second_landmark: "another landmark has to be seen",
  consistent_observations: "what was seen does not agree well enough",
  no_rival_pose: "another place would explain what was seen nearly as well",
};

// Of an answer's hypotheses on the wire.
export const fromAnswer = (hypotheses) => (hypotheses ?? []).filter((h) => h.map_from_robot?.pose).map((h) => ({
  probability: h.probability, covariance: h.map_from_robot.covariance, ...h.map_from_robot.pose,
}));

// Of the server's own account.
export const fromServer = (found) => found.hypotheses;

export const inWords = (missing) => (missing ?? []).map((condition) => WORDS[condition] ?? condition).join(", ");

export function positionText(robot) {
  const best = robot.hypotheses?.[0];
  if (!best) return "not localised yet";
  const places = robot.hypotheses.length;
  const why = inWords(robot.missing);
  return `${places === 1 ? "one possible place" : `${places} possible places`}, the best ${(100 * best.probability).toFixed(0)} %${why ? `: ${why}` : ""}`;
}

export function drawHypotheses(c, name, robot, px, pxPerM, colour) {
  c.strokeStyle = c.fillStyle = colour;
  c.font = "12px system-ui";
  // The best last, on top.
  for (const h of [...(robot.hypotheses ?? [])].reverse()) {
    const [a, b, d] = [h.covariance[0], h.covariance[1], h.covariance[4]];
    const mean = (a + d) / 2, root = Math.hypot((a - d) / 2, b);
    const axes = [mean + root, Math.max(mean - root, 0)].map((v) => Math.max(Math.sqrt(v * CHI2_2_95) * pxPerM, 5));
    const [u, v] = px(h.x_m, h.y_m);
    const strength = FAINTEST + (1 - FAINTEST) * Math.min(h.probability, 1);
    c.beginPath();
    c.ellipse(u, v, axes[0], axes[1], -0.5 * Math.atan2(2 * b, a - d), 0, 2 * Math.PI);
    c.globalAlpha = 0.6 * strength;
    c.fill();
    c.globalAlpha = Math.max(strength, 0.35);
    c.lineWidth = 1.5;
    c.stroke();
    c.beginPath();
    c.moveTo(u, v);
    c.lineTo(u + 14 * Math.cos(h.theta_rad), v - 14 * Math.sin(h.theta_rad));
    c.stroke();
    c.globalAlpha = 1;
    const share = 100 * h.probability;
    if (share >= 1) c.fillText(`${name}? ${share.toFixed(0)} %`, u + axes[0] + 4, v - 4);
  }
}
