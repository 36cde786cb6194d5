"use strict";
// Draws what the robot's program sends, says what was drawn, and carries STOP.

const $ = (id) => document.getElementById(id);
const query = location.search;
const STALE_MS = 700, RETRY_MS = 1000, PLOT_S = 10, WORDS_MS = 150;
const STOP_KEPT_MS = 5000; // a STOP that nobody heard is sent again where the line comes back so soon
const NEAR_CM = 30, FAR_CM = 300;
const DOUBT = 0.2; // of a depth: what is less sure than this is drawn faintly
const RAMP = ["#ff5544", "#ff9b2f", "#f2d23c", "#78d46c", "#35c4c8", "#4b93f0", "#8f7bea"]; // near to far
const STAGE_COLOURS = ["#8f7bea", "#4b93f0", "#35b3b8", "#5bb456", "#d9b52c", "#ef8b2c", "#e2564a", "#999"];
const GOOD_ENDS = ["goal", "explored", "approached"];

let socket = null, phase = "wait", heardAt = 0, stopping = false, pressedAt = -Infinity;
let picture = null, shot = null, known = null, view = null, colours = {};
let took = null, wordsAt = 0;
const queue = [], drawnAt = [], history = [];
let drawing = false;
// What tests and benchmarks look at.
const live = (window.live = { shots: 0, polygons: 0, labels: 0, cells: 0, phase: () => phase });

// ---- The line to the program ----

function connect() {
  socket = new WebSocket(`ws://${location.host}/live${query}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => {
    heardAt = performance.now();
    if (typeof event.data === "string") hear(JSON.parse(event.data));
    else { queue.push(event.data); drawQueue(); }
  };
  socket.onopen = () => { if (unheard()) sendStop(); };
  socket.onclose = () => {
    const why = "no connection to the robot's program: it has ended, or the network is gone";
    if (phase !== "end") setPhase("gone", unheard() ? UNHEARD : why);
    setTimeout(connect, RETRY_MS);
  };
}

function hear(note) {
  if (note.kind === "drawn") took = note;
  else if (note.kind === "wait") setPhase("wait", note.text);
  else if (note.kind === "stopped") { pressedAt = -Infinity; setPhase("stopped", note.reason); }
  else if (note.kind === "end") {
    pressedAt = -Infinity;
    const said = note.outcome === "stopped" || note.reason.startsWith(note.outcome);
    const words = said ? note.reason : `${note.outcome}: ${note.reason}`;
    setPhase("end", `ended: ${words}`);
    tell($("reason"), GOOD_ENDS.includes(note.outcome) ? "good" : note.outcome === "stopped" ? "bad" : "warn");
    chip("ended", "");
    $("speed").textContent = "–"; // nobody asks the robot any more
    if (shot) sayReasons([...shot.reasons, [shot.t_s, words]]);
  }
}

function setPhase(next, words) {
  phase = next;
  document.body.dataset.phase = next;
  $("reason").textContent = words;
  tell($("reason"), next === "stopped" || next === "gone" ? "bad" : "");
  if (next === "gone") chip("no connection", "bad");
  if (next === "wait") { chip("starting", ""); stopping = false; history.length = 0; }
  const button = $("stop");
  button.disabled = next === "end";
  const said = stopping && next !== "end" ? "STOPPING" : "STOP";
  button.firstChild.textContent = next === "stopped" ? "STOPPED" : said;
}

const UNHEARD = "STOP cannot be sent, there is no connection: press the button on the robot";
const unheard = () => performance.now() - pressedAt < STOP_KEPT_MS;

// Both ways at once: whichever is quicker. Being told twice changes nothing.
function sendStop() {
  if (socket.readyState === WebSocket.OPEN) socket.send('{"stop":true}');
  fetch(`/stop${query}`, { method: "POST", keepalive: true }).catch(() => {});
}

function stop() {
  if (phase === "end") return;
  pressedAt = performance.now();
  sendStop();
  if (phase === "gone") { $("reason").textContent = UNHEARD; return; }
  stopping = true;
  if (phase !== "stopped") $("stop").firstChild.textContent = "STOPPING";
  if (navigator.vibrate) navigator.vibrate(80);
}
$("stop").addEventListener("pointerdown", stop);
$("stop").addEventListener("click", stop);
addEventListener("keydown", (event) => {
  if (event.code !== "Space" && event.key !== "Escape") return;
  event.preventDefault();
  if (!event.repeat) stop();
});

// ---- One picture after the other ----

async function drawQueue() {
  if (drawing) return;
  drawing = true;
  while (queue.length) {
    const [next, jpeg, cells] = unpack(queue.shift());
    const blob = new Blob([jpeg], { type: "image/jpeg" });
    if (jpeg.length) picture = await createImageBitmap(blob).catch(() => picture);
    shot = next;
    known = cells;
    note(shot);
    drawCamera(shot);
    drawMap(shot.map, cells);
    sayState(shot);
    live.shots += 1;
    drawnAt.push(performance.now());
    // Once the browser begins its next frame this one is out.
    const drawn = () => {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ drawn: next.number }));
    };
    if (document.hidden) drawn();
    else requestAnimationFrame(drawn);
  }
  drawing = false;
}

function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const content = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const jpeg = new Uint8Array(buffer, 4 + length, content.jpeg_bytes);
  return [content, jpeg, new Int8Array(buffer, 4 + length + content.jpeg_bytes)];
}

function note(content) {
  if (phase === "wait" || phase === "gone") setPhase("drive", content.reason);
  history.push([content.t_s, ...content.wheels.wanted, ...content.wheels.real]);
  while (history.length && history[0][0] < content.t_s - PLOT_S) history.shift();
}

// ---- Canvases ----

function surface(canvas) {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const w = Math.round(width * ratio), h = Math.round(height * ratio);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const paint = canvas.getContext("2d");
  paint.setTransform(ratio, 0, 0, ratio, 0, 0);
  return [paint, width, height];
}

function depthColour(cm) {
  const within = Math.min(Math.max(cm, NEAR_CM), FAR_CM);
  const at = (RAMP.length - 1) * Math.log(within / NEAR_CM) / Math.log(FAR_CM / NEAR_CM);
  const k = Math.min(Math.floor(at), RAMP.length - 2), part = at - k;
  const [a, b] = [RAMP[k], RAMP[k + 1]].map((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)));
  return `rgb(${a.map((v, i) => Math.round(v + (b[i] - v) * part)).join(",")})`;
}

function drawCamera(content) {
  const [paint, width, height] = surface($("camera"));
  paint.fillStyle = colours.card;
  paint.fillRect(0, 0, width, height);
  const size = content.picture || (picture && { width: picture.width, height: picture.height, regions: [] });
  if (!picture || !size) return;
  const scale = Math.min(width / size.width, height / size.height);
  const x0 = (width - size.width * scale) / 2, y0 = (height - size.height * scale) / 2;
  paint.imageSmoothingQuality = "high";
  paint.drawImage(picture, x0, y0, size.width * scale, size.height * scale);
  const regions = [...size.regions].sort((a, b) => b.area - a.area);
  // Whole coordinates are the middles of pixels.
  const shapes = regions.map((region) => {
    const shape = new Path2D();
    for (const loop of region.loops) {
      for (let i = 0; i < loop.length; i += 2) {
        const x = x0 + (loop[i] + 0.5) * scale, y = y0 + (loop[i + 1] + 0.5) * scale;
        if (i) shape.lineTo(x, y); else shape.moveTo(x, y);
      }
      shape.closePath();
    }
    return shape;
  });
  const tint = (region) => (region.depth_cm === null ? "rgba(235,238,240,0.75)" : depthColour(region.depth_cm));
  const doubted = (region) => region.depth_cm === null || region.sigma_cm > DOUBT * region.depth_cm;
  paint.save();
  paint.beginPath();
  paint.rect(x0, y0, size.width * scale, size.height * scale);
  paint.clip();
  regions.forEach((region, k) => {
    if (region.depth_cm === null) return;
    paint.globalAlpha = doubted(region) ? 0.07 : 0.17;
    paint.fillStyle = tint(region);
    paint.fill(shapes[k], "evenodd");
  });
  paint.globalAlpha = 1;
  paint.lineJoin = "round";
  paint.strokeStyle = "rgba(10,14,16,0.6)";
  paint.lineWidth = 4;
  shapes.forEach((shape) => paint.stroke(shape));
  regions.forEach((region, k) => {
    paint.strokeStyle = tint(region);
    paint.lineWidth = doubted(region) ? 1.2 : 2.2;
    paint.setLineDash(region.moving ? [7, 4] : []);
    paint.stroke(shapes[k]);
  });
  paint.setLineDash([]);
  if (scale > 1.4) drawCorners(paint, regions, x0, y0, scale);
  paint.restore();
  live.polygons = shapes.length;
  live.labels = drawLabels(paint, regions, x0, y0, scale, width, height);
}

function drawCorners(paint, regions, x0, y0, scale) {
  paint.fillStyle = "#fff";
  paint.beginPath();
  for (const region of regions) for (const loop of region.loops) {
    for (let i = 0; i < loop.length; i += 2) {
      paint.rect(x0 + (loop[i] + 0.5) * scale - 1.5, y0 + (loop[i + 1] + 0.5) * scale - 1.5, 3, 3);
    }
  }
  paint.fill();
}

// The middles of the widest stretches of a region along some of its rows, the best first; and its box.
function middles(region) {
  const xs = region.loops[0].filter((_, i) => i % 2 === 0), ys = region.loops[0].filter((_, i) => i % 2);
  const box = { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
  const found = [];
  for (const share of [0.5, 0.35, 0.65, 0.2, 0.8]) {
    const y = box.top + share * (box.bottom - box.top), crossings = [];
    for (const loop of region.loops) for (let i = 0, n = loop.length; i < n; i += 2) {
      const xa = loop[i], ya = loop[i + 1], xb = loop[(i + 2) % n], yb = loop[(i + 3) % n];
      if ((ya > y) !== (yb > y)) crossings.push(xa + (xb - xa) * (y - ya) / (yb - ya));
    }
    crossings.sort((a, b) => a - b);
    let best = [0, 0, y];
    for (let i = 0; i + 1 < crossings.length; i += 2) {
      const wide = crossings[i + 1] - crossings[i];
      if (wide > best[0]) best = [wide, (crossings[i] + crossings[i + 1]) / 2, y];
    }
    if (best[0]) found.push(best);
  }
  // The first, in the middle, unless another is clearly wider.
  found.sort((a, b) => Math.round(3 * Math.log(b[0] / a[0])));
  return [found.map(([, x, y]) => [x, y]), box];
}

function drawLabels(paint, regions, x0, y0, scale, width, height) {
  const letters = width < 500 ? 12 : 14, high = letters + 9, taken = [];
  paint.textBaseline = "middle";
  const free = ([x, y], box) => !taken.some(([tx, ty, wide]) =>
    x < tx + wide + 2 && tx < x + box + 2 && y < ty + high + 2 && ty < y + high + 2);
  // In the region; at the rim of one that is smaller than its label, or not much larger.
  const placeFor = (region, box) => {
    const [spots, around] = middles(region);
    const x = (around.left + around.right) / 2, rim = high / 2 / scale + 2;
    const outside = [[x, around.bottom + rim], [x, around.top - rim]], tall = ((around.bottom - around.top) * scale) / high;
    if (tall < 2) spots.unshift(...outside);
    else if (tall < 4) spots.push(...outside);
    return spots.map(([x, y]) => [
      Math.min(Math.max(x0 + (x + 0.5) * scale - box / 2, x0 + 3), width - x0 - box - 3),
      Math.min(Math.max(y0 + (y + 0.5) * scale - high / 2, y0 + 3), height - y0 - high - 3),
    ]).find((place) => free(place, box));
  };
  const known = regions.filter((region) => region.depth_cm !== null).sort((a, b) => a.depth_cm - b.depth_cm);
  for (const region of known) {
    const digits = region.sigma_cm !== null && region.sigma_cm < 2 ? 1 : 0;
    const depth = region.depth_cm.toFixed(digits);
    const sigma = region.sigma_cm === null ? "" : ` ±${region.sigma_cm.toFixed(digits)}`;
    const last = region.moving ? " moving" : "";
    paint.font = `600 ${letters}px system-ui, sans-serif`;
    const first = paint.measureText(depth).width;
    paint.font = `400 ${letters - 1}px system-ui, sans-serif`;
    const box = first + paint.measureText(sigma + last).width + 19;
    const place = placeFor(region, box);
    if (!place) continue;
    const [x, y] = place;
    taken.push([x, y, box]);
    paint.fillStyle = "rgba(13,17,19,0.78)";
    paint.beginPath();
    paint.roundRect(x, y, box, high, 5);
    paint.fill();
    paint.fillStyle = depthColour(region.depth_cm);
    paint.beginPath();
    paint.roundRect(x, y, 5, high, [5, 0, 0, 5]);
    paint.fill();
    paint.fillStyle = region.sigma_cm > DOUBT * region.depth_cm ? "#a9b3b3" : "#fff";
    paint.font = `600 ${letters}px system-ui, sans-serif`;
    paint.fillText(depth, x + 11, y + high / 2 + 0.5);
    paint.fillStyle = "#c4cccc";
    paint.font = `400 ${letters - 1}px system-ui, sans-serif`;
    paint.fillText(sigma + last, x + 11 + first, y + high / 2 + 0.5);
  }
  return taken.length;
}

const grid = document.createElement("canvas");

function drawMap(map, cells) {
  const [paint, width, height] = surface($("map"));
  paint.fillStyle = colours.unknown;
  paint.fillRect(0, 0, width, height);
  const at = follow(map, width, height);
  const px = ([x, z]) => [width / 2 + (x - at.x) * at.scale, height / 2 - (z - at.z) * at.scale];
  live.cells = map.rows * map.cols;
  if (live.cells) {
    drawCells(map, cells);
    const [left, bottom] = px([map.x_cm, map.z_cm]);
    const wide = map.cols * map.cell_cm * at.scale, high = map.rows * map.cell_cm * at.scale;
    paint.imageSmoothingEnabled = false;
    paint.drawImage(grid, left, bottom - high, wide, high);
  }
  drawGrid(paint, width, height, at);
  const pairs = (flat) => Array.from({ length: flat.length / 2 }, (_, i) => px([flat[2 * i], flat[2 * i + 1]]));
  const line = (points, colour, dash, thick) => {
    if (points.length < 2) return;
    paint.strokeStyle = colour;
    paint.lineWidth = thick;
    paint.setLineDash(dash);
    paint.lineJoin = paint.lineCap = "round";
    paint.beginPath();
    points.forEach(([x, y], i) => (i ? paint.lineTo(x, y) : paint.moveTo(x, y)));
    paint.stroke();
    paint.setLineDash([]);
  };
  line(pairs(map.path), colours.path, [], 2.5);
  line(pairs(map.way), colours.way, [2, 7], 3);
  map.goals.forEach((goal, k) => drawGoal(paint, px(goal), map.goals.length > 1 ? `${k + 1}` : ""));
  for (const mover of map.movers) drawMover(paint, px(mover), mover, at.scale);
  if (map.here) drawRobot(paint, px(map.here), map.here[2], map.radius_cm * at.scale);
}

function follow(map, width, height) {
  const xs = [], zs = [];
  const add = (x, z, r) => { xs.push(x - r, x + r); zs.push(z - r, z + r); };
  if (map.rows) {
    add(map.x_cm, map.z_cm, 0);
    add(map.x_cm + map.cols * map.cell_cm, map.z_cm + map.rows * map.cell_cm, 0);
  }
  for (const goal of map.goals) add(goal[0], goal[1], 15);
  for (let i = 0; i < map.path.length; i += 2) add(map.path[i], map.path[i + 1], map.radius_cm);
  if (!xs.length) add(0, 0, 75);
  const [x0, x1, z0, z1] = [Math.min(...xs), Math.max(...xs), Math.min(...zs), Math.max(...zs)];
  const wide = Math.max(x1 - x0, 150) + 20, high = Math.max(z1 - z0, 150) + 20;
  const aim = { x: (x0 + x1) / 2, z: (z0 + z1) / 2, scale: Math.min(width / wide, height / high) };
  const part = view ? 0.2 : 1; // so that it glides
  view = view || aim;
  for (const key of ["x", "z", "scale"]) view[key] += part * (aim[key] - view[key]);
  return view;
}

function drawCells(map, cells) {
  if (grid.width !== map.cols || grid.height !== map.rows) { grid.width = map.cols; grid.height = map.rows; }
  const paint = grid.getContext("2d"), image = paint.createImageData(map.cols, map.rows);
  for (let row = 0; row < map.rows; row++) {
    for (let col = 0; col < map.cols; col++) {
      const evidence = cells[row * map.cols + col] / map.full;
      const [r, g, b] = evidence > 0 ? colours.filledRgb : colours.freeRgb;
      const to = 4 * ((map.rows - 1 - row) * map.cols + col);
      image.data[to] = r; image.data[to + 1] = g; image.data[to + 2] = b;
      image.data[to + 3] = 255 * Math.min(1, Math.abs(evidence) * (evidence > 0 ? 0.6 : 1));
    }
  }
  paint.putImageData(image, 0, 0);
}

function drawGrid(paint, width, height, at) {
  const step = 50 * at.scale >= 28 ? 50 : 100;
  paint.strokeStyle = colours.grid;
  paint.lineWidth = 1;
  paint.globalAlpha = 0.45;
  paint.beginPath();
  for (let x = Math.ceil((at.x - width / 2 / at.scale) / step) * step; ; x += step) {
    const p = width / 2 + (x - at.x) * at.scale;
    if (p > width) break;
    paint.moveTo(Math.round(p) + 0.5, 0); paint.lineTo(Math.round(p) + 0.5, height);
  }
  for (let z = Math.ceil((at.z - height / 2 / at.scale) / step) * step; ; z += step) {
    const p = height / 2 - (z - at.z) * at.scale;
    if (p < 0) break;
    paint.moveTo(0, Math.round(p) + 0.5); paint.lineTo(width, Math.round(p) + 0.5);
  }
  paint.stroke();
  paint.globalAlpha = 1;
  paint.fillStyle = paint.strokeStyle = colours.muted;
  paint.font = "11px system-ui, sans-serif";
  paint.textBaseline = "alphabetic";
  const long = step * at.scale;
  paint.fillRect(12, height - 13, long, 2);
  paint.fillText(step === 50 ? "50 cm" : "1 m", 12, height - 18);
}

function drawGoal(paint, [x, y], name) {
  paint.strokeStyle = paint.fillStyle = colours.goal;
  paint.lineWidth = 3;
  paint.beginPath();
  paint.arc(x, y, 9, 0, 7);
  paint.stroke();
  paint.beginPath();
  paint.arc(x, y, 3, 0, 7);
  paint.fill();
  paint.font = "600 12px system-ui, sans-serif";
  if (name) paint.fillText(name, x + 13, y + 4);
}

function drawMover(paint, [x, y], [, , vx, vz, half], scale) {
  paint.strokeStyle = paint.fillStyle = colours.bad;
  paint.lineWidth = 2.5;
  paint.beginPath();
  paint.arc(x, y, Math.max(half * scale, 5), 0, 7);
  paint.stroke();
  const tip = [x + vx * scale, y - vz * scale], heading = Math.atan2(-vz, vx);
  paint.beginPath();
  paint.moveTo(x, y);
  paint.lineTo(...tip);
  for (const side of [-2.6, 2.6]) {
    paint.moveTo(...tip);
    paint.lineTo(tip[0] + 7 * Math.cos(heading + side), tip[1] + 7 * Math.sin(heading + side));
  }
  paint.stroke();
}

function drawRobot(paint, [x, y], heading, radius) {
  const r = Math.max(radius, 7);
  paint.save();
  paint.translate(x, y);
  paint.rotate(heading);
  paint.fillStyle = colours.robot;
  paint.globalAlpha = 0.28;
  paint.beginPath();
  paint.arc(0, 0, r, 0, 7);
  paint.fill();
  paint.globalAlpha = 1;
  paint.strokeStyle = colours.robot;
  paint.lineWidth = 2;
  paint.stroke();
  paint.beginPath();
  paint.moveTo(0, -r * 0.78);
  paint.lineTo(r * 0.5, r * 0.42);
  paint.lineTo(0, r * 0.16);
  paint.lineTo(-r * 0.5, r * 0.42);
  paint.fill();
  paint.restore();
}

function drawWheels() {
  const [paint, width, height] = surface($("wheels"));
  paint.clearRect(0, 0, width, height);
  if (!history.length) return;
  const end = history[history.length - 1][0], speeds = history.flatMap((row) => row.slice(1));
  const most = Math.max(10, ...speeds), least = Math.min(0, ...speeds);
  const step = most - least > 50 ? 20 : most - least > 22 ? 10 : 5;
  const top = Math.ceil(most / step) * step, low = Math.floor(least / step) * step;
  const left = 34, foot = 10, head = 8;
  const x = (t) => left + (width - left - 12) * (1 - (end - t) / PLOT_S);
  const y = (v) => head + (height - foot - head) * (top - v) / (top - low);
  paint.font = "11px system-ui, sans-serif";
  paint.textBaseline = "middle";
  paint.textAlign = "right";
  paint.lineWidth = 1;
  for (let v = low; v <= top; v += step) {
    paint.strokeStyle = v ? colours.line : colours.muted;
    paint.beginPath();
    paint.moveTo(left, Math.round(y(v)) + 0.5); paint.lineTo(width - 12, Math.round(y(v)) + 0.5);
    paint.stroke();
    paint.fillStyle = colours.muted;
    paint.fillText(v, left - 6, y(v));
  }
  paint.textAlign = "left";
  const curve = (column, colour, dash, thick) => {
    paint.strokeStyle = colour;
    paint.lineWidth = thick;
    paint.setLineDash(dash);
    paint.lineJoin = "round";
    paint.beginPath();
    for (const row of history) paint.lineTo(x(row[0]), y(row[column]));
    paint.stroke();
    paint.setLineDash([]);
  };
  curve(3, colours.left, [], 2);
  curve(4, colours.right, [], 2);
  paint.globalAlpha = 0.75;
  curve(1, colours.left, [2, 3], 1.5);
  curve(2, colours.right, [2, 3], 1.5);
  paint.globalAlpha = 1;
}

// ---- Words ----

function tell(element, kind) { if (element.dataset.kind !== kind) element.dataset.kind = kind; }
function chip(words, kind) {
  if ($("state").textContent !== words) $("state").textContent = words;
  tell($("state"), kind);
}

function sayState(content) {
  if (phase === "drive") {
    const stands = /^stop/.test(content.reason);
    if ($("reason").textContent !== content.reason) $("reason").textContent = content.reason;
    tell($("reason"), content.refused ? "bad" : stands ? "warn" : "good");
    chip(content.fault || content.state, content.fault ? "bad" : /ing$/.test(content.state) ? "good" : "");
  }
  const now = performance.now();
  if (now - wordsAt < WORDS_MS) return; // numbers that change more often cannot be read
  wordsAt = now;
  drawWheels();
  const link = content.link, real = content.wheels.real;
  $("task").textContent = content.task;
  document.title = `${content.t_s.toFixed(0)} s ${content.task}`;
  $("time").textContent = `${content.t_s.toFixed(1)} s`;
  $("driven").textContent = `${(content.distance_cm / 100).toFixed(2)} m`;
  $("speed").textContent = `${((real[0] + real[1]) / 2).toFixed(0)} cm/s`;
  $("battery").textContent = link.battery_v === null ? "–" : `${link.battery_v.toFixed(1)} V`;
  sayTiming(content);
  sayLink(content, link);
  sayReasons(content.reasons);
}

const round = (value) => (value === null || value === undefined ? "–" : value.toFixed(0));

function sayTiming(content) {
  const now = performance.now();
  while (drawnAt.length > 2 && drawnAt[0] < now - 2000) drawnAt.shift();
  const last = drawnAt.length - 1;
  const rate = last > 1 ? (1000 * last) / (drawnAt[last] - drawnAt[0]) : null;
  $("command").textContent = round(took?.command_ms);
  $("drawn").textContent = round(took?.ms);
  $("rate").textContent = round(rate);
  const stages = Object.entries(content.stages);
  const whole = Math.max(50, stages.reduce((sum, [, ms]) => sum + ms, 0));
  $("bar").replaceChildren(...stages.map(([, ms], k) => {
    const part = document.createElement("span");
    part.style.cssText = `width:${(100 * ms) / whole}%;background:${STAGE_COLOURS[k % STAGE_COLOURS.length]}`;
    return part;
  }));
  $("stages").replaceChildren(...stages.map(([name, ms], k) => {
    const [item, dot, time] = ["li", "i", "b"].map((name) => document.createElement(name));
    dot.style.background = STAGE_COLOURS[k % STAGE_COLOURS.length];
    time.textContent = ms.toFixed(1);
    item.append(dot, `${name} `, time);
    return item;
  }));
}

function sayLink(content, link) {
  for (const [name, values] of [["lost", link.lost], ["crc", link.crc]]) values.forEach((value, k) => {
    $(name + k).textContent = value === null ? "–" : value;
    $(name + k).className = value ? "bad" : "";
  });
  $("trip").textContent = link.round_trip_ms === null ? "–" : `${link.round_trip_ms.toFixed(1)} ms`;
  $("again").textContent = link.reconnections;
  $("dropped").textContent = `${content.dropped} of ${content.frames + content.dropped}`;
}

function sayReasons(reasons) {
  $("reasons").replaceChildren(...reasons.slice().reverse().map(([t, words]) => {
    const item = document.createElement("li"), time = document.createElement("time");
    time.textContent = t.toFixed(1);
    if (/^stop/.test(words)) item.className = "stop";
    item.append(time, words);
    return item;
  }));
}

// ---- What does not come from the program ----

function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["unknown", "free", "filled", "grid", "path", "way", "goal", "robot", "left", "right", "muted",
    "line", "card", "bad"];
  colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  colours.freeRgb = rgb(colours.free);
  colours.filledRgb = rgb(colours.filled);
}

function redraw() {
  if (!shot) return;
  view = null;
  drawCamera(shot);
  drawMap(shot.map, known);
  drawWheels();
}

setInterval(() => {
  const silent = performance.now() - heardAt, old = phase === "drive" && silent > STALE_MS;
  $("stale").hidden = !old;
  if (old) $("stale").textContent = `no picture for ${(silent / 1000).toFixed(1)} s`;
}, 100);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); redraw(); });
addEventListener("resize", redraw);
readColours();
$("near").textContent = `${NEAR_CM}`;
$("far").textContent = `${FAR_CM} cm`;
$("ramp").style.background = `linear-gradient(90deg, ${RAMP.join(",")})`;
connect();
