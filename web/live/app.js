// The live page: the map from above with every robot's trajectories, and the last frame of one camera with its quads.
// Reads the HTTP API once, then follows `maps/{map}/live` (server-sent events). Draws at most once per animation frame.

import { offer, wireUp as wireUpFirstMap } from "/live/first-map.js";
import { drawFrame, quadCells } from "/live/frame.js";
import { drawHypotheses, fromAnswer, fromServer, positionText } from "/live/hypotheses.js";
import { drawModalities, loadModalities } from "/live/modalities.js";
import { named, trustText } from "/live/naming.js";
import { api } from "/live/session.js";

const API = "/api/v1";
const TRAJECTORY_POINTS = 4000; // per robot and kind: the oldest are forgotten
// A fused pose that is older is no pose.
const MAX_POSE_AGE_S = 2;
const CHI2_2_95 = 5.991; // 95 % of a two-dimensional Gaussian

const byId = (id) => document.getElementById(id);
const state = {
  map: null, walls: [], landmarks: [], chosen: null, area: null, robots: new Map(), cameras: new Map(), camera: null,
  view: { x_m: 0, y_m: 0, px_per_m: 40, fitted: false }, recognised: new Map(), dirty: true, source: null,
};

const getJson = async (path) => {
  const answer = await api(path, { headers: { accept: "application/json" } });
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.json();
};

// ---- what is heard ----

function robotOf(name) {
  if (!state.robots.has(name)) {
    state.robots.set(name, { trajectories: { truth: [], odometry: [], pose: [] }, covariance: null, hypotheses: [], missing: [], frames: 0, recognised: 0, byPose: 0, corrections: 0, trust: null });
    byId("robot-hint").textContent = "";
  }
  return state.robots.get(name);
}

function extend(name, kind, pose) {
  const trajectory = robotOf(name).trajectories[kind];
  const last = trajectory[trajectory.length - 1];
  if (last && Math.hypot(last.x_m - pose.x_m, last.y_m - pose.y_m) < 0.005 && Math.abs(last.theta_rad - pose.theta_rad) < 0.005) return;
  trajectory.push(pose);
  if (trajectory.length > TRAJECTORY_POINTS) trajectory.shift();
}

const heard = {
  pose(e) {
    extend(e.robot, "pose", e.pose);
    const robot = robotOf(e.robot);
    robot.covariance = e.covariance;
    robot.corrections = e.corrections;
    robot.trust = e.trust;
    robot.posed = performance.now() - e.age_ms;
    robot.hypotheses = [];
  },
  odometry(e) { extend(e.robot, "odometry", e.pose); },
  truth(e) { extend(e.robot, "truth", e.pose); },
  answer(e) {
    const robot = robotOf(e.robot);
    robot.frames += 1;
    robot.hypotheses = fromAnswer(e.answer.hypotheses);
    for (const quad of e.answer.quads) {
      const name = named(quad);
      if (!name) continue;
      robot[name.byPose ? "byPose" : "recognised"] += 1;
      state.recognised.set(name.landmark, performance.now());
    }
    const key = `${e.robot}/${e.camera}`;
    if (!state.cameras.has(key)) {
      byId("camera-choice").add(new Option(key, key));
      state.camera ??= key;
    }
    state.cameras.set(key, e.answer);
    if (key === state.camera) showFrame(key, e.answer);
  },
  map_changed() { loadMap(state.map); },
};

function follow(map) {
  state.source?.close();
  const source = new EventSource(`${API}/maps/${encodeURIComponent(map)}/live`);
  state.source = source;
  const link = byId("link");
  source.onopen = () => { link.textContent = "live"; link.className = "link-live"; };
  source.onerror = () => {
    // Refused, and not only interrupted: whoever is not signed in is asked.
    if (source.readyState === EventSource.CLOSED) api("/whoami").catch(() => { /* asked already */ });
    link.textContent = "connection lost, trying again"; link.className = "link-lost";
  };
  for (const [kind, hear] of Object.entries(heard)) {
    source.addEventListener(kind, (event) => { hear(JSON.parse(event.data)); state.dirty = true; });
  }
}

// ---- the frame ----

let frameBusy = false;
async function showFrame(key, answer) {
  if (frameBusy) return; // the next answer brings a newer one
  frameBusy = true;
  try {
    const [robot, camera] = key.split("/");
    const reply = await api(`/robots/${robot}/cameras/${camera}/frame?seq=${answer.seq}`, { cache: "no-store" });
    if (!reply.ok) return;
    const picture = await createImageBitmap(await reply.blob());
    drawFrame(byId("frame"), picture, answer);
    byId("quads").replaceChildren(...quadCells(answer).map(row));
    byId("frame-hint").textContent = answer.pose_refusal_detail?.sentence ?? "";
    const work = (answer.timings ?? []).reduce((sum, t) => sum + t.ms, 0);
    byId("frame-facts").textContent = answer.rejection
      ? `frame ${answer.seq} refused, ${answer.rejection.field}: ${answer.rejection.detail}`
      : `frame ${answer.seq}: ${answer.status}, ${answer.quads.length} ${answer.quads.length === 1 ? "quad" : "quads"}, ` +
        `${work.toFixed(1)} ms of work, answered after ${answer.latency_ms.toFixed(0)} ms`;
  } finally { frameBusy = false; }
}

function row(cells) {
  const tr = document.createElement("tr");
  for (const cell of cells) tr.insertCell().append(cell ?? "");
  return tr;
}

// ---- the map ----

function fit() {
  const xs = [], ys = [];
  for (const w of state.walls) for (const [x, y] of [w.a, w.b]) { xs.push(x); ys.push(y); }
  for (const l of state.landmarks) if (l.place) { xs.push(l.place.x_m); ys.push(l.place.y_m); }
  if (state.underlay) {
    const { picture, place } = state.underlay, [c, s] = [Math.cos(place.theta_rad), Math.sin(place.theta_rad)];
    for (const [u, v] of [[0, 0], [picture.width, 0], [0, picture.height], [picture.width, picture.height]]) {
      const [x, y] = [u * place.metres_per_pixel, v * place.metres_per_pixel];
      xs.push(place.x_m + c * x - s * y);
      ys.push(place.y_m + s * x + c * y);
    }
  }
  if (!xs.length) return;
  const canvas = byId("map");
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const scale = Math.min((canvas.clientWidth - 40) / Math.max(x1 - x0, 1), (canvas.clientHeight - 40) / Math.max(y1 - y0, 1));
  state.view = { x_m: (x0 + x1) / 2, y_m: (y0 + y1) / 2, px_per_m: scale, fitted: true };
  state.dirty = true;
}

const layerOn = (name) => document.querySelector(`[data-layer=${name}]`).checked;

function resolveColours() {
  // light-dark() resolves only on a used property, so ask a probe element.
  const probe = document.createElement("span");
  document.body.append(probe);
  const resolved = {};
  for (const name of ["wall", "landmark", "truth", "odometry", "pose", "hypothesis", "laser", "faint", "line", "ink"]) {
    probe.style.color = `var(--${name})`;
    resolved[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return resolved;
}

function drawMap() {
  if (!state.dirty) return;
  state.dirty = false;
  const canvas = byId("map");
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
    if (!state.view.fitted) fit();
  }
  const c = canvas.getContext("2d");
  const { x_m, y_m, px_per_m } = state.view;
  const px = (x, y) => [w / 2 + (x - x_m) * px_per_m, h / 2 - (y - y_m) * px_per_m];
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, w, h);
  c.lineCap = "round";
  const ink = resolveColours();
  drawGrid(c, w, h, ink);
  drawModalities(c, px, ink);
  drawArea(c, px, ink);
  drawUnderlay(c, px, px_per_m);
  if (layerOn("walls")) {
    stroke(c, ink.wall, 2.5);
    for (const wall of state.walls) { line(c, px(...wall.a), px(...wall.b)); }
  }
  if (layerOn("landmarks")) for (const landmark of state.landmarks) drawLandmark(c, landmark, px, ink);
  for (const kind of ["truth", "odometry", "pose"]) {
    if (!layerOn(kind)) continue;
    for (const [name, robot] of state.robots) drawTrajectory(c, name, robot, kind, px, ink);
  }
  if (layerOn("hypotheses")) for (const [name, robot] of state.robots) drawHypotheses(c, name, robot, px, px_per_m, ink.hypothesis);
}

const stroke = (c, style, width) => { c.strokeStyle = style; c.fillStyle = style; c.lineWidth = width; };
const line = (c, a, b) => { c.beginPath(); c.moveTo(...a); c.lineTo(...b); c.stroke(); };

function drawGrid(c, w, h, ink) {
  const { x_m, y_m, px_per_m } = state.view;
  const step = [0.5, 1, 2, 5, 10, 20, 50, 100].find((s) => s * px_per_m >= 40) ?? 100;
  stroke(c, ink.line, 1);
  for (let x = Math.ceil((x_m - w / 2 / px_per_m) / step) * step; x < x_m + w / 2 / px_per_m; x += step) {
    const u = w / 2 + (x - x_m) * px_per_m;
    line(c, [u, 0], [u, h]);
  }
  for (let y = Math.ceil((y_m - h / 2 / px_per_m) / step) * step; y < y_m + h / 2 / px_per_m; y += step) {
    const v = h / 2 - (y - y_m) * px_per_m;
    line(c, [0, v], [w, v]);
  }
  stroke(c, ink.faint, 2);
  line(c, [12, h - 12], [12 + step * px_per_m, h - 12]);
  c.font = "12px system-ui";
  c.fillText(`${step} m`, 16, h - 17);
}

// The picture that the map was imported from, beneath everything that is known better.
function drawUnderlay(c, px, px_per_m) {
  if (!state.underlay || !layerOn("underlay")) return;
  const { picture, place } = state.underlay;
  const scale = px_per_m * place.metres_per_pixel;
  c.save();
  c.translate(...px(place.x_m, place.y_m));
  c.rotate(-place.theta_rad);
  c.globalAlpha = 0.5;
  c.drawImage(picture, 0, -picture.height * scale, picture.width * scale, picture.height * scale);
  c.restore();
}

async function loadUnderlay(map) {
  const path = `/maps/${encodeURIComponent(map)}/underlay`;
  const underlay = await getJson(path).catch(() => null);
  const reply = underlay && await api(`${path}/image`);
  const picture = reply?.ok ? await createImageBitmap(await reply.blob()) : null;
  if (state.map !== map) return;
  state.underlay = picture && { picture, place: underlay.place };
  state.dirty = true;
}

// From where the chosen landmark is seen.
function drawArea(c, px, ink) {
  if (!state.area) return;
  c.fillStyle = ink.landmark;
  c.globalAlpha = 0.18;
  for (const rings of state.area.geometry.coordinates) {
    c.beginPath();
    for (const ring of rings) {
      ring.forEach(([x, y], i) => (i ? c.lineTo(...px(x, y)) : c.moveTo(...px(x, y))));
      c.closePath();
    }
    c.fill("evenodd"); // a second ring is a hole
  }
  c.globalAlpha = 1;
}

const whyNot = (landmark) => landmark.failed_gates.map((gate) => `${gate.sentence} ${gate.advice}`).join(" ");

// Landmarks that are not in use, and why: also those without a place, which the map does not show.
function listNotInUse() {
  const rows = state.landmarks.filter((l) => l.failed_gates.length).map((l) => row([l.name, whyNot(l)]));
  byId("not-in-use").hidden = !rows.length;
  byId("not-in-use-count").textContent = rows.length;
  byId("not-in-use-rows").replaceChildren(...rows);
}

async function choose(landmark) {
  state.chosen = landmark?.name ?? null;
  state.area = null;
  state.dirty = true;
  byId("chosen").textContent = landmark ? factsOf(landmark) : "";
  if (!landmark?.place || !landmark.size) return;
  const path = `/maps/${encodeURIComponent(state.map)}/landmarks/${encodeURIComponent(landmark.name)}/visibility`;
  const area = await getJson(path).catch(() => null);
  if (!area || state.chosen !== landmark.name) return;
  state.area = area;
  state.dirty = true;
  byId("chosen").textContent = `${factsOf(landmark)}, seen from ${area.properties.area_m2.toFixed(1)} m²`;
}

function factsOf(landmark) {
  const finding = landmark.finding;
  if (landmark.failed_gates.length) return `${landmark.name}: ${whyNot(landmark)}`;
  if (landmark.health === "sound" || !finding) return `${landmark.name}: ${landmark.health === "sound" ? landmark.status : landmark.health}`;
  const why = finding.kind === "moved" ? `appears ${finding.offset_m.toFixed(2)} m from its place, ${finding.sightings} times` : `not seen where it should be, ${finding.missed_frames} times`;
  return `${landmark.name}: ${landmark.health}, ${why}`;
}

// The landmark under the pointer, within 14 pixels of its middle.
function landmarkAt(event) {
  const canvas = byId("map");
  const box = canvas.getBoundingClientRect();
  const { x_m, y_m, px_per_m } = state.view;
  const x = x_m + (event.clientX - box.left - canvas.clientWidth / 2) / px_per_m;
  const y = y_m - (event.clientY - box.top - canvas.clientHeight / 2) / px_per_m;
  const near = state.landmarks.filter((l) => l.place).map((l) => [Math.hypot(l.place.x_m - x, l.place.y_m - y), l]);
  near.sort((a, b) => a[0] - b[0]);
  return near.length && near[0][0] * px_per_m < 14 ? near[0][1] : null;
}

function drawLandmark(c, landmark, px, ink) {
  const place = landmark.place;
  if (!place) return;
  const half = (landmark.size?.width_m ?? 0.5) / 2;
  const [dx, dy] = [-Math.sin(place.theta_rad) * half, Math.cos(place.theta_rad) * half];
  const seen = performance.now() - (state.recognised.get(landmark.name) ?? -1e9) < 800;
  stroke(c, ink.landmark, seen ? 9 : 5);
  line(c, px(place.x_m - dx, place.y_m - dy), px(place.x_m + dx, place.y_m + dy));
  const [u, v] = px(place.x_m + 0.35 * Math.cos(place.theta_rad), place.y_m + 0.35 * Math.sin(place.theta_rad));
  c.font = seen || state.chosen === landmark.name ? "bold 12px system-ui" : "12px system-ui";
  const label = landmark.health === "sound" ? landmark.name : `${landmark.name} (${landmark.health})`;
  c.fillText(label, u - c.measureText(label).width / 2, v + 4);
  if (seen) state.dirty = true; // to dim it again in time
}

function drawTrajectory(c, name, robot, kind, px, ink) {
  const trajectory = robot.trajectories[kind];
  if (!trajectory.length) return;
  // The truth lies wide and pale beneath, so that a corrected trajectory on top of it is still seen.
  stroke(c, ink[kind], kind === "truth" ? 6 : 1.6);
  c.globalAlpha = kind === "truth" ? 0.35 : 1;
  c.beginPath();
  trajectory.forEach((p, i) => (i ? c.lineTo(...px(p.x_m, p.y_m)) : c.moveTo(...px(p.x_m, p.y_m))));
  c.stroke();
  c.globalAlpha = 1;
  c.lineWidth = 1.6;
  const last = trajectory[trajectory.length - 1];
  const [u, v] = px(last.x_m, last.y_m);
  c.save();
  c.translate(u, v);
  c.rotate(-last.theta_rad);
  c.beginPath();
  c.moveTo(9, 0); c.lineTo(-6, 5); c.lineTo(-6, -5);
  c.closePath();
  c.fill();
  c.restore();
  if (kind !== "pose") return;
  if (robot.covariance) ellipse(c, u, v, robot.covariance);
  c.font = "12px system-ui";
  c.fillText(name, u + 10, v - 8);
}

function ellipse(c, u, v, covariance) {
  const [a, b, d] = [covariance[0], covariance[1], covariance[4]];
  const mean = (a + d) / 2, root = Math.hypot((a - d) / 2, b);
  const axes = [mean + root, Math.max(mean - root, 0)].map((e) => Math.sqrt(e * CHI2_2_95) * state.view.px_per_m);
  c.beginPath();
  c.ellipse(u, v, Math.max(axes[0], 1), Math.max(axes[1], 1), -0.5 * Math.atan2(2 * b, a - d), 0, 2 * Math.PI);
  c.stroke();
}

// ---- the robots ----

// What a robot that relocalises still needs.
async function askMissing() {
  for (const [name, robot] of state.robots) {
    if (!robot.hypotheses.length) continue;
    const found = await getJson(`/robots/${encodeURIComponent(name)}/relocalisation`).catch(() => null);
    robot.missing = found?.missing ?? [];
  }
}

function errorOf(robot, kind) {
  const truth = robot.trajectories.truth.at(-1), other = robot.trajectories[kind].at(-1);
  return truth && other ? `${Math.hypot(truth.x_m - other.x_m, truth.y_m - other.y_m).toFixed(2)} m` : "";
}

function listRobots() {
  const rows = [...state.robots].sort(([a], [b]) => a.localeCompare(b)).map(([name, robot]) => {
    const pose = robot.trajectories.pose.at(-1);
    const sigma = robot.covariance ? `${Math.sqrt(robot.covariance[0] + robot.covariance[4]).toFixed(2)} m` : "";
    // The server publishes no pose that is older: what is shown then is where the robot was.
    const age_s = robot.posed === undefined ? Infinity : (performance.now() - robot.posed) / 1000;
    const old = pose && age_s > MAX_POSE_AGE_S ? (Number.isFinite(age_s) ? `, ${age_s.toFixed(0)} s ago` : ", formerly") : "";
    return row([name, pose ? `${pose.x_m.toFixed(2)}, ${pose.y_m.toFixed(2)} m, ${(pose.theta_rad * 180 / Math.PI).toFixed(0)}°${old}` : positionText(robot),
      sigma, pose && !old ? trustText(robot.trust) : "", robot.frames, robot.recognised, robot.byPose, robot.corrections, errorOf(robot, "pose"), errorOf(robot, "odometry")]);
  });
  byId("robots").replaceChildren(...rows);
}

// ---- start ----

async function loadMap(name) {
  const [map, walls, landmarks] = await Promise.all([
    getJson(`/maps/${encodeURIComponent(name)}`), getJson(`/maps/${encodeURIComponent(name)}/walls`),
    getJson(`/maps/${encodeURIComponent(name)}/landmarks?limit=500`),
  ]);
  await loadTrajectories(name);
  Object.assign(state, { map: name, walls: walls.segments, landmarks: landmarks.items, dirty: true });
  listNotInUse();
  loadUnderlay(name).then(() => {
    offer(name, !state.walls.length && !state.underlay);
    if (!state.view.fitted) fit();
  });
  if (state.chosen) choose(state.landmarks.find((l) => l.name === state.chosen));
  const active = state.landmarks.filter((l) => l.status === "active").length;
  const where = [map.site, map.building, map.floor].filter(Boolean).join(" / ");
  const lies = map.parent ? `, in ${map.parent.map} at ${map.parent.x_m.toFixed(1)}, ${map.parent.y_m.toFixed(1)} m` : "";
  byId("map-facts").textContent = `${where}${where ? ", " : ""}version ${map.version}, ${active} of ${state.landmarks.length} landmarks active, ${state.walls.length} walls${lies}`;
  byId("map-hint").textContent = state.walls.length || state.landmarks.some((l) => l.place) ? "" : "This map has no walls and no placed landmarks yet. Walls come from a grid, a plan or a laser log: waymark map import.";
  if (!state.view.fitted) fit();
  loadModalities(name, () => { state.dirty = true; });
  window.dispatchEvent(new CustomEvent("map-loaded", { detail: { map: name, landmarks: state.landmarks } }));
}

// Where the map's robots have been before this page was opened.
async function loadTrajectories(map) {
  const robots = (await getJson("/robots?limit=100")).items.filter((robot) => robot.map === map);
  for (const { name, pose } of robots.filter((robot) => !state.robots.has(robot.name))) {
    const trajectories = await getJson(`/robots/${encodeURIComponent(name)}/trajectories`);
    if (trajectories.pose.length || trajectories.odometry.length || trajectories.truth.length) Object.assign(robotOf(name).trajectories, trajectories);
    if (pose) Object.assign(robotOf(name), { covariance: pose.covariance, trust: pose.trust, posed: performance.now() - pose.age_ms });
    const found = await getJson(`/robots/${encodeURIComponent(name)}/relocalisation`);
    if (found.relocalising && found.map === map) Object.assign(robotOf(name), { hypotheses: fromServer(found), missing: found.missing });
  }
}

// Maps under the site and building they belong to, floors from below; those that say nothing come first.
function grouped(maps) {
  const groups = new Map();
  for (const map of maps) {
    const key = [map.site, map.building].filter(Boolean).join(" / ");
    groups.set(key, [...(groups.get(key) ?? []), map]);
  }
  const level = (map) => map.parent?.level_m ?? 0;
  const order = (a, b) => level(a) - level(b) || (a.floor ?? "").localeCompare(b.floor ?? "") || a.name.localeCompare(b.name);
  return [...groups].sort(([a], [b]) => a.localeCompare(b)).flatMap(([key, members]) => {
    const options = members.sort(order).map((m) => new Option(m.floor ? `${m.floor}: ${m.name}` : m.name, m.name));
    if (!key) return options;
    const group = document.createElement("optgroup");
    group.label = key;
    group.append(...options);
    return [group];
  });
}

// The list anew, and where the map of this page lies.
async function mapsChanged() {
  const choice = byId("map-choice"), chosen = choice.value;
  choice.replaceChildren(...grouped((await getJson("/maps?limit=500")).items));
  choice.value = chosen;
  await loadMap(chosen);
}

async function start() {
  const maps = (await getJson("/maps?limit=500")).items;
  const choice = byId("map-choice");
  choice.replaceChildren(...grouped(maps));
  const asked = new URLSearchParams(location.search).get("map");
  const name = maps.some((m) => m.name === asked) ? asked : maps[0]?.name;
  if (!name) {
    byId("map-hint").textContent = "There is no map yet.";
    offer(null, true);
    setTimeout(start, 2000);
    return;
  }
  choice.value = name;
  await loadMap(name);
  follow(name);
}

function wireUp() {
  wireUpFirstMap((name) => { location.search = `?map=${encodeURIComponent(name)}`; });
  window.addEventListener("maps-changed", () => mapsChanged().catch(() => { /* the next change brings it */ }));
  byId("map-choice").addEventListener("change", (e) => { location.search = `?map=${encodeURIComponent(e.target.value)}`; });
  byId("camera-choice").addEventListener("change", (e) => {
    state.camera = e.target.value;
    showFrame(state.camera, state.cameras.get(state.camera));
  });
  byId("layers").addEventListener("change", () => { state.dirty = true; });
  byId("fit").addEventListener("click", fit);
  window.addEventListener("resize", () => { state.dirty = true; });
  const canvas = byId("map");
  const zoom = (factor, u, v) => {
    const view = state.view;
    const dx = (u - canvas.clientWidth / 2) / view.px_per_m, dy = -(v - canvas.clientHeight / 2) / view.px_per_m;
    const next = Math.min(Math.max(view.px_per_m * factor, 2), 2000);
    view.x_m += dx * (1 - view.px_per_m / next);
    view.y_m += dy * (1 - view.px_per_m / next);
    view.px_per_m = next;
    state.dirty = true;
  };
  let pressed = [0, 0];
  canvas.addEventListener("pointerdown", (e) => { pressed = [e.clientX, e.clientY]; });
  canvas.addEventListener("click", (e) => {
    // The end of a drag chooses nothing.
    if (Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) < 4) choose(landmarkAt(e));
  });
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom(Math.exp(-e.deltaY / 400), e.offsetX, e.offsetY); }, { passive: false });
  canvas.addEventListener("pointermove", (e) => {
    if (!(e.buttons & 1)) return;
    state.view.x_m -= e.movementX / state.view.px_per_m;
    state.view.y_m += e.movementY / state.view.px_per_m;
    state.dirty = true;
  });
  canvas.addEventListener("keydown", (e) => {
    const step = 60 / state.view.px_per_m;
    const act = { "+": () => zoom(1.25, canvas.clientWidth / 2, canvas.clientHeight / 2),
      "-": () => zoom(0.8, canvas.clientWidth / 2, canvas.clientHeight / 2),
      ArrowLeft: () => { state.view.x_m -= step; }, ArrowRight: () => { state.view.x_m += step; },
      ArrowUp: () => { state.view.y_m += step; }, ArrowDown: () => { state.view.y_m -= step; } }[e.key];
    if (!act) return;
    e.preventDefault();
    act();
    state.dirty = true;
  });
}

wireUp();
start().catch((error) => {
  byId("map-hint").textContent = `The server does not answer as expected (${error.message}). Reload to try again.`;
});
setInterval(listRobots, 500);
setInterval(askMissing, 2000);
const loop = () => { drawMap(); requestAnimationFrame(loop); };
loop();
