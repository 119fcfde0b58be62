"""The 3-D view of a report: paths of vehicle and pad on a canvas, turned by dragging, drawn by the page's own forty lines.

No library and no network. Points are metres, local NED, relative to the first one; the page turns them and leaves out
perspective, so that lengths can be compared. The slider is time.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from companion.telemetry.flight_record import FlightRecord, Series

MOST_POINTS = 700


def scene_html(record: FlightRecord) -> str:
    """A canvas with its data and script; empty where nothing was known of a path."""
    vehicle, pad = paths(record)
    if len(vehicle.t_s) < 2:
        return ""
    origin = vehicle.values[0]
    content = {
        "vehicle": _points(vehicle, origin),
        "pad": _points(pad, origin),
        "phases": [[round(t_s, 2), str(phase)] for t_s, phase, _ in record.phases],
    }
    data = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    return f'<div class="scene">{CANVAS}<script type="application/json" id="scene-data">{data}</script></div>{SCRIPT}'


def paths(record: FlightRecord) -> tuple[Series, Series]:
    """Vehicle and pad as they were where that is known, else as Companion believed them."""
    if record.true_vehicle.t_s:
        return record.true_vehicle, record.true_pad
    return record.vehicle, record.pad


def _points(series: Series, origin: Sequence[float]) -> list[list[float]]:
    """[t, north, east, up]"""
    stride = max(1, -(-len(series.t_s) // MOST_POINTS))
    chosen = [*range(0, len(series.t_s), stride)]
    if series.t_s and chosen[-1] != len(series.t_s) - 1:
        chosen.append(len(series.t_s) - 1)
    return [
        [
            round(series.t_s[i], 2),
            *(round(series.values[i][k] - origin[k], 3) for k in range(2)),
            round(-series.values[i][2], 3),
        ]
        for i in chosen
    ]


CANVAS = """<canvas id="scene" width="1148" height="460" style="width:100%;touch-action:none"></canvas>
<div class="row"><input type="range" id="scene-time" min="0" max="1000" value="1000" style="flex:1">
<output id="scene-says"></output></div>
<p class="note">Drag to turn, wheel to come closer, slider for time. Blue: vehicle, orange: pad; grid 10 m (or 1 m).</p>"""

SCRIPT = """<script>
(() => {
const data = JSON.parse(document.getElementById('scene-data').textContent);
const canvas = document.getElementById('scene'), pen = canvas.getContext('2d');
const slider = document.getElementById('scene-time'), says = document.getElementById('scene-says');
const all = data.vehicle.concat(data.pad);
const low = [1, 2, 3].map(k => Math.min(...all.map(p => p[k]))), high = [1, 2, 3].map(k => Math.max(...all.map(p => p[k])));
const middle = low.map((v, k) => (v + high[k]) / 2), size = Math.max(2, ...low.map((v, k) => high[k] - v));
const ground = Math.min(0, low[2]), step = size > 25 ? 10 : 1;
let turn = -0.7, tilt = 0.5, zoom = 1;
const end = Math.max(...data.vehicle.map(p => p[0]));
function at(n, e, u) {
  const x = e - middle[1], y = n - middle[0], z = u - middle[2], s = 0.95 * canvas.height / size * zoom;
  const a = x * Math.cos(turn) + y * Math.sin(turn), b = y * Math.cos(turn) - x * Math.sin(turn);
  return [canvas.width / 2 + a * s, canvas.height / 2 - (z * Math.cos(tilt) + b * Math.sin(tilt)) * s];
}
function line(points, colour, width) {
  pen.beginPath(); pen.strokeStyle = colour; pen.lineWidth = width;
  points.forEach((p, i) => { const [x, y] = at(p[1], p[2], p[3]); i ? pen.lineTo(x, y) : pen.moveTo(x, y); });
  pen.stroke();
}
function dot(p, colour) { const [x, y] = at(p[1], p[2], p[3]); pen.fillStyle = colour; pen.beginPath(); pen.arc(x, y, 6, 0, 7); pen.fill(); }
function draw() {
  const now = slider.value / 1000 * end;
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const from = [0, 1].map(k => Math.floor(low[k] / step) * step), to = [0, 1].map(k => Math.ceil(high[k] / step) * step);
  for (let n = from[0]; n <= to[0]; n += step) line([[0, n, from[1], ground], [0, n, to[1], ground]], '#e2e8f0', 1);
  for (let e = from[1]; e <= to[1]; e += step) line([[0, from[0], e, ground], [0, to[0], e, ground]], '#e2e8f0', 1);
  const [nx, ny] = at(to[0], (from[1] + to[1]) / 2, ground); pen.fillStyle = '#475569'; pen.font = '14px system-ui'; pen.fillText('N', nx, ny - 6);
  const shown = name => data[name].filter(p => p[0] <= now), vehicle = shown('vehicle'), pad = shown('pad');
  line(vehicle.map(p => [0, p[1], p[2], ground]), '#cbd5e1', 1);
  line(pad, '#ea580c', 2); line(vehicle, '#2563eb', 2);
  if (pad.length) dot(pad[pad.length - 1], '#ea580c');
  if (vehicle.length) {
    const last = vehicle[vehicle.length - 1];
    line([last, [0, last[1], last[2], ground]], '#94a3b8', 1); dot(last, '#2563eb');
  }
  const phase = data.phases.filter(p => p[0] <= now).pop();
  says.textContent = now.toFixed(1) + ' s ' + (phase ? phase[1] : '');
}
let held = null;
canvas.addEventListener('pointerdown', e => { held = [e.clientX, e.clientY, turn, tilt]; canvas.setPointerCapture(e.pointerId); });
canvas.addEventListener('pointermove', e => {
  if (!held) return;
  turn = held[2] - (e.clientX - held[0]) / 150; tilt = Math.min(1.57, Math.max(0, held[3] + (e.clientY - held[1]) / 150)); draw();
});
canvas.addEventListener('pointerup', () => { held = null; });
canvas.addEventListener('wheel', e => { e.preventDefault(); zoom = Math.min(40, Math.max(0.5, zoom * Math.exp(-e.deltaY / 500))); draw(); }, {passive: false});
slider.addEventListener('input', draw);
draw();
})();
</script>"""
