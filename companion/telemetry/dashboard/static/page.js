// The page: draws what /live sends, posts what is clicked. No library, no build step, nothing from other computers.
"use strict";

const $ = (id) => document.getElementById(id);
const COLOUR = { pad: "#38bdf8", vehicle: "#facc15", grid: "#1e293b", text: "#94a3b8", found: "#22c55e", setpoint: "#f472b6" };
const TRAIL = 600;
const STALE_MS = 1500;
const trail = [];
let about = { ladder: [], pad: { length_m: 1.5, width_m: 1.5 }, settings: {} };
let passed = new Set();
let shot = null;
let lastMessage = 0;
let scale = 6;

// ---------------------------------------------------------------------------------------------------------- connection

async function begin() {
  try {
    about = await (await fetch("settings")).json();
  } catch {
    setTimeout(begin, 2000);
    return;
  }
  document.title = $("title").textContent = about.title;
  fill($("settings"), Object.entries(about.settings));
  connect();
}

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "blob";
  socket.onopen = () => $("events").replaceChildren();
  socket.onmessage = (event) => (typeof event.data === "string" ? show(JSON.parse(event.data)) : drawCamera(event.data));
  socket.onclose = () => setTimeout(connect, 1000);
}

setInterval(() => {
  const isStale = performance.now() - lastMessage > STALE_MS;
  document.body.classList.toggle("stale", isStale);
  if (isStale) lamp($("link"), 2, "no connection to Companion");
}, 250);

// ------------------------------------------------------------------------------------------------------------ commands

for (const button of document.querySelectorAll("#buttons button")) {
  button.addEventListener("click", () => (button.dataset.careful === undefined || button.classList.contains("asking") ? say(button) : makeSure(button)));
}

function makeSure(button) {
  const label = button.textContent;
  button.classList.add("asking");
  button.textContent = "Really start?";
  setTimeout(() => { button.classList.remove("asking"); button.textContent = label; }, 3000);
}

async function say(button) {
  const action = button.dataset.action;
  $("answer").textContent = `${action} …`;
  try {
    const reply = await fetch("command", { method: "POST", body: JSON.stringify({ action }) });
    $("answer").textContent = reply.ok ? `${action}: handed over, see the events` : `${action}: NOT taken: ${await reply.text()}`;
  } catch {
    $("answer").textContent = `${action}: NOT taken: Companion does not answer`;
  }
}

// ------------------------------------------------------------------------------------------------------------- numbers

function show(now) {
  lastMessage = performance.now();
  if (now.shot) shot = now.shot;
  const { mission, vehicle, pad, status } = now;
  showLink(status);
  showLadder(mission ? mission.phase : "idle");
  $("note").textContent = mission ? mission.note : "";
  fill($("numbers"), [
    ["from the pad N, E", pair(mission && mission.position_m, "m")],
    ["height above pad", number(mission && mission.height_m, "m")],
    ["against it N, E", pair(mission && mission.velocity_m_s, "m/s")],
    ["pad seen", mission && mission.is_seen ? "yes" : "no"],
    ["pad, 1 sigma", number(pad && pad.sigma_m, "m")],
    ["pad speed", pad ? number(Math.hypot(pad.velocity_m_s[0], pad.velocity_m_s[1]), "m/s") : "–"],
    ["last sight, beacon", pad ? `${age(pad.vision_age_s)}, ${age(pad.beacon_age_s)}` : "–"],
    ["motion model", pad ? pad.model : "–"],
    ["vehicle N, E, D", triple(vehicle && vehicle.velocity_m_s) ?? "–"],
    ["setpoint N, E, D", triple(now.setpoint_m_s) ?? "none"],
    ["go-arounds", mission ? String(mission.go_arounds) : "–"],
    ["battery", status && status.battery !== null ? `${(100 * status.battery).toFixed(0)} %` : "–"],
    ["state, setpoints", `${now.rates_hz.state}, ${now.rates_hz.setpoints} Hz`],
    ["frames, seen, beacon", `${now.rates_hz.frames}, ${now.rates_hz.seen}, ${now.rates_hz.beacon} Hz`],
    ["time", `${now.t_s.toFixed(1)} s`],
  ]);
  showHealth(now.health);
  for (const event of now.events) addEvent(event);
  if (mission && mission.position_m) {
    trail.push(mission.position_m);
    if (trail.length > TRAIL) trail.shift();
    drawPlan(now);
    drawSide(now);
  } else {
    for (const id of ["plan", "side"]) sayEmpty($(id), "no pad known yet");
  }
}

function showHealth(health) {
  const worstFirst = [...health].sort((a, b) => b.level - a.level);
  const lines = worstFirst.map((h) => {
    const li = lamp(document.createElement("li"), h.level, `${h.subject}: ${h.text}`);
    if (h.level === 0) li.className = "fine";
    return li;
  });
  $("health").replaceChildren(...(lines.length ? lines : [lamp(document.createElement("li"), 0, "no warning")]));
}

function showLink(status) {
  if (!status || !status.is_connected) return lamp($("link"), 2, "vehicle not heard");
  const words = [status.mode, status.is_armed ? "armed" : "disarmed", status.landed.replace("_", " ")];
  if (status.has_failsafe) words.push("FAILSAFE");
  return lamp($("link"), status.has_failsafe ? 2 : 0, words.join(", "));
}

function showLadder(phase) {
  const index = about.ladder.indexOf(phase);
  if (phase === "idle") passed = new Set();
  about.ladder.slice(0, Math.max(0, index)).forEach((name) => passed.add(name));
  const steps = about.ladder.map((name) => item(name, name === phase ? "now" : passed.has(name) ? "passed" : ""));
  if (index < 0) steps.push(item(phase, "aside"));
  $("ladder").replaceChildren(...steps);
  $("ladder").dataset.phase = phase;
}

function item(text, className) {
  const li = document.createElement("li");
  li.textContent = text.replace("_", " ");
  li.className = className;
  return li;
}

function addEvent(event) {
  const li = document.createElement("li");
  li.className = event.kind;
  for (const text of [event.t_s.toFixed(1) + " s", event.kind, event.text]) li.appendChild(document.createElement("span")).textContent = text;
  const list = $("events");
  list.prepend(li);
  while (list.children.length > 300) list.lastChild.remove();
}

function fill(table, rows) {
  while (table.rows.length < rows.length) { const row = table.insertRow(); row.insertCell(); row.insertCell(); }
  rows.forEach(([name, value], i) => { table.rows[i].cells[0].textContent = name; table.rows[i].cells[1].textContent = value; });
}

function lamp(element, level, text) {
  element.dataset.level = level;
  element.textContent = text;
  return element;
}

const number = (value, unit) => (value === null || value === undefined ? "–" : `${value.toFixed(2)} ${unit}`);
const pair = (vector, unit) => (vector ? `${vector[0].toFixed(2)}, ${vector[1].toFixed(2)} ${unit}` : "–");
const triple = (vector) => (vector ? `${vector.map((v) => v.toFixed(1)).join(", ")} m/s` : null);
const age = (seconds) => (seconds === null ? "never" : `${seconds.toFixed(1)} s`);

// ------------------------------------------------------------------------------------------------------------- drawing

async function drawCamera(blob) {
  const found = shot;
  let image;
  try { image = await createImageBitmap(blob); } catch { return; }
  const canvas = $("camera"), pen = canvas.getContext("2d");
  if (canvas.width !== image.width || canvas.height !== image.height) { canvas.width = image.width; canvas.height = image.height; }
  pen.drawImage(image, 0, 0);
  image.close();
  $("caption").textContent = found ? found.text : "";
  if (found) drawCorners(pen, found.corners_px);
}

function drawCorners(pen, corners) {
  pen.strokeStyle = pen.fillStyle = COLOUR.found;
  pen.lineWidth = 2;
  for (let first = 0; corners.length % 4 === 0 && first < corners.length; first += 4) {
    pen.beginPath();
    corners.slice(first, first + 4).forEach(([x, y]) => pen.lineTo(x + 0.5, y + 0.5));
    pen.closePath();
    pen.stroke();
  }
  for (const [x, y] of corners) { pen.beginPath(); pen.arc(x + 0.5, y + 0.5, 3, 0, 7); pen.fill(); }
}

function drawPlan(now) {
  const canvas = $("plan"), pen = canvas.getContext("2d");
  const [north, east] = now.mission.position_m;
  const wanted = Math.max(2.5, 1.25 * Math.hypot(north, east));
  scale += 0.15 * (wanted - scale);
  const perMetre = canvas.height / 2 / scale;
  const at = (n, e) => [canvas.width / 2 + e * perMetre, canvas.height / 2 - n * perMetre];
  clear(pen, canvas);
  const ring = step(scale);
  for (let r = ring; r < 2 * scale; r += ring) circle(pen, ...at(0, 0), r * perMetre, `${round(r)} m`);
  if (now.pad) {
    drawPad(pen, at, now.pad.yaw_rad);
    arrow(pen, at(0, 0), at(now.pad.velocity_m_s[0], now.pad.velocity_m_s[1]), COLOUR.pad);
  }
  line(pen, trail.map(([n, e]) => at(n, e)));
  if (now.setpoint_m_s) arrow(pen, at(north, east), at(north + now.setpoint_m_s[0], east + now.setpoint_m_s[1]), COLOUR.setpoint);
  if (now.vehicle) drawVehicle(pen, at(north, east), now.vehicle.yaw_rad);
}

function drawSide(now) {
  const canvas = $("side"), pen = canvas.getContext("2d");
  const yaw = now.pad ? now.pad.yaw_rad : 0;
  const along = ([n, e]) => n * Math.cos(yaw) + e * Math.sin(yaw);
  const height = ([, , d]) => -d;
  const here = now.mission.position_m;
  const span = Math.max(2.5, 1.2 * Math.max(Math.abs(along(here)), height(here)));
  const perMetre = Math.min(canvas.width / 2, canvas.height - 40) / span;
  const at = (a, h) => [canvas.width / 2 + a * perMetre, canvas.height - 28 - h * perMetre];
  clear(pen, canvas);
  const gap = step(span);
  for (let h = gap; h < 2 * span; h += gap) level(pen, canvas, at(0, h)[1], `${round(h)} m`);
  level(pen, canvas, at(0, 0)[1], "pad");
  pen.fillStyle = COLOUR.pad;
  const [left, top] = at(-about.pad.length_m / 2, 0);
  pen.fillRect(left, top, about.pad.length_m * perMetre, 5);
  line(pen, trail.map((p) => at(along(p), height(p))));
  const [x, y] = at(along(here), height(here));
  pen.fillStyle = COLOUR.vehicle;
  pen.fillRect(x - 11, y - 3, 22, 4);
  pen.fillRect(x - 3, y - 6, 6, 8);
}

function clear(pen, canvas) {
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.font = "11px system-ui, sans-serif";
  pen.lineWidth = 1;
}

function sayEmpty(canvas, text) {
  const pen = canvas.getContext("2d");
  clear(pen, canvas);
  pen.font = `${Math.round(canvas.width / 28)}px system-ui, sans-serif`;
  pen.fillStyle = COLOUR.text;
  pen.textAlign = "center";
  pen.fillText(text, canvas.width / 2, canvas.height / 2);
  pen.textAlign = "start";
}

function circle(pen, x, y, radius, label) {
  pen.strokeStyle = COLOUR.grid;
  pen.beginPath(); pen.arc(x, y, radius, 0, 7); pen.stroke();
  pen.fillStyle = COLOUR.text;
  pen.fillText(label, x + 4, y - radius + 12);
}

function level(pen, canvas, y, label) {
  pen.strokeStyle = COLOUR.grid;
  pen.beginPath(); pen.moveTo(0, y); pen.lineTo(canvas.width, y); pen.stroke();
  pen.fillStyle = COLOUR.text;
  pen.fillText(label, 4, y - 3);
}

function drawPad(pen, at, yaw) {
  const [l, w] = [about.pad.length_m / 2, about.pad.width_m / 2];
  pen.strokeStyle = COLOUR.pad;
  pen.fillStyle = "#38bdf833";
  pen.beginPath();
  for (const [x, y] of [[l, -w], [l, w], [-l, w], [-l, -w]]) pen.lineTo(...at(x * Math.cos(yaw) - y * Math.sin(yaw), x * Math.sin(yaw) + y * Math.cos(yaw)));
  pen.closePath(); pen.fill(); pen.stroke();
}

function drawVehicle(pen, [x, y], yaw) {
  pen.save();
  pen.translate(x, y); pen.rotate(yaw);
  pen.fillStyle = COLOUR.vehicle;
  pen.beginPath(); pen.moveTo(0, -10); pen.lineTo(7, 8); pen.lineTo(0, 4); pen.lineTo(-7, 8); pen.closePath(); pen.fill();
  pen.restore();
}

function arrow(pen, [x0, y0], [x1, y1], colour) {
  if (Math.hypot(x1 - x0, y1 - y0) < 4) return;
  const a = Math.atan2(y1 - y0, x1 - x0);
  pen.strokeStyle = colour; pen.lineWidth = 2;
  pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1);
  for (const turn of [2.6, -2.6]) { pen.moveTo(x1, y1); pen.lineTo(x1 + 7 * Math.cos(a + turn), y1 + 7 * Math.sin(a + turn)); }
  pen.stroke(); pen.lineWidth = 1;
}

function line(pen, points) {
  pen.strokeStyle = "#facc1599"; pen.lineWidth = 1.5;
  pen.beginPath(); points.forEach(([x, y]) => pen.lineTo(x, y)); pen.stroke(); pen.lineWidth = 1;
}

function step(span) {
  const power = 10 ** Math.floor(Math.log10(span));
  return span / power > 5 ? 2 * power : span / power > 2 ? power : power / 2;
}

const round = (value) => Number(value.toPrecision(3));

sayEmpty($("camera"), "no picture yet");
begin();
