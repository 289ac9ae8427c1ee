// The rotating body, one view per law: hub, panels and axes are polygons, drawn from back to front.
"use strict";

const views = [...document.querySelectorAll(".view")].map((box, law) => ({
  canvas: box.querySelector("canvas"), angle: box.querySelector("output"), frames: scene.attitudes[law],
}));

// Computes q v q*, which takes body components to target components.
function turn(q, v) {
  const u = [q[1], q[2], q[3]];
  const t = cross(u, v).map((c) => 2 * c);
  return plus(plus(v, t, q[0]), cross(u, t));
}

// Interpolates between two frames along the shorter way.
function between(frames, where) {
  const k = Math.min(Math.floor(where), frames.length - 1);
  const a = frames[k];
  const b = frames[Math.min(k + 1, frames.length - 1)];
  const s = Math.min(where - k, 1) * (a.reduce((sum, c, i) => sum + c * b[i], 0) < 0 ? -1 : 1);
  const w = 1 - Math.abs(s);
  const q = a.map((c, i) => w * c + s * b[i]);
  const size = Math.hypot(...q);
  return q.map((c) => c / size);
}

// Returns the six faces of a box, given by two opposite corners in principal axes; corners run counter-clockwise from outside.
function faces(low, high, colours) {
  return [0, 1, 2].flatMap((axis) => [-1, 1].map((way) => {
    const [i, j] = way > 0 ? [(axis + 1) % 3, (axis + 2) % 3] : [(axis + 2) % 3, (axis + 1) % 3];
    const corner = (a, b) => {
      const c = [0, 0, 0];
      c[axis] = way > 0 ? high[axis] : low[axis];
      c[i] = a ? high[i] : low[i];
      c[j] = b ? high[j] : low[j];
      return c;
    };
    return { points: [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)], colour: colours[axis], axis, way };
  }));
}

// The outline has the proportions of the uniform box with the craft's inertia; its longest edge is split in panel, hub, panel.
function craft() {
  const half = scene.size;
  const long = half.indexOf(Math.max(...half));
  const thin = half.indexOf(Math.min(...half));
  const cut = 0.42 * half[long];
  const part = (from, to, thick, colours, kind) => {
    const low = half.map((h) => -h);
    const high = half.slice();
    low[long] = from;
    high[long] = to;
    low[thin] *= thick;
    high[thin] *= thick;
    return { centre: (from + to) / 2, list: faces(low, high, colours), kind, long, thin };
  };
  const panel = ["#34456b", "#34456b", "#34456b"];
  panel[thin] = "#23407e";
  const gap = 0.07 * half[long];
  return {
    long,
    parts: [part(-half[long], -cut - gap, 0.06, panel, "panel"), part(-cut, cut, 1, ["#c9a24b", "#d9b766", "#e7cd8f"], "hub"),
      part(cut + gap, half[long], 0.06, panel, "panel")],
  };
}
let model = craft();
// Principal axes are the columns of scene.axes.
const toBody = (p) => [0, 1, 2].map((i) => dot(scene.axes[i], p));

// The direction of the Earth at a frame, in target axes.
function toEarth(where) {
  const toward = mix(scene.earth, where);
  const size = Math.hypot(...toward) || 1;
  return toward.map((c) => c / size);
}

// The third axis of the orbital frame points at the Earth, down in the picture, so the view is half a turn about the first axis.
const upright = (view) => (scene.down
  ? Object.fromEntries(Object.entries(view).map(([name, v]) => [name, [v[0], -v[1], -v[2]]])) : view);

function shade(colour, light) {
  const n = parseInt(colour.slice(1), 16);
  return `rgb(${[n >> 16, (n >> 8) & 255, n & 255].map((c) => Math.round(Math.min(255, c * light))).join(",")})`;
}

function paint(view, where) {
  const { frames } = view;
  const { pen, width, height } = cleared(view.canvas);
  const q = between(frames, where);
  view.angle.textContent = `${(2 * Math.atan2(Math.hypot(q[1], q[2], q[3]), Math.abs(q[0])) * 180 / Math.PI).toPrecision(3)}°`
    + (where > frames.length - 1 ? " diverged" : "");

  const { away, right, up } = upright(stance());
  const lamp = plus(plus(away, up, 0.6), right, -0.5).map((c) => c / 1.27);
  const scale = Math.min(width - 30, 0.95 * height - 24) * (scene.down ? 0.33 : scene.earth ? 0.31 : 0.385);
  // The view is off centre, because only the positive half of each target axis is drawn; the Earth may be anywhere.
  const flat = (p) => [width / 2 + scale * dot(p, right), (scene.down ? 0.37 : scene.earth ? 0.51 : 0.56) * height - scale * dot(p, up)];

  function line(from, to, colour, thick, dash) {
    pen.beginPath();
    pen.setLineDash(dash);
    pen.moveTo(...flat(from));
    pen.lineTo(...flat(to));
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.stroke();
    pen.setLineDash([]);
  }
  function label(p, text, colour, style) {
    const [x0, y0] = flat([0, 0, 0]);
    const [x1, y1] = flat(p);
    const far = 1 + 12 / Math.max(Math.hypot(x1 - x0, y1 - y0), 12);
    const [x, y] = [x0 + far * (x1 - x0), y0 + far * (y1 - y0)];
    pen.font = `${style} 13px system-ui, sans-serif`;
    pen.fillStyle = colour;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(text, x, y);
  }
  const unit = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const names = ["x", "y", "z"];
  const colours = names.map((n) => css(`--axis-${n}`));
  // Half-axes that point away are painted before the body, those towards the reader after it.
  const drawAxes = (front) => unit.forEach((e, i) => {
    if (dot(e, away) > 0 === front) {
      line([0, 0, 0], e.map((c) => 1.24 * c), colours[i], 1.4, [6, 5]);
    }
    const b = turn(q, e);
    if (dot(b, away) > 0 === front) {
      const root = b.map((c) => c * reach(i));
      const tip = b.map((c) => c * 1.08);
      line(root, tip, colours[i], 3, []);
      pen.beginPath();
      pen.arc(...flat(tip), 3.6, 0, 7);
      pen.fillStyle = colours[i];
      pen.fill();
      label(tip, names[i], colours[i], "bold");
    }
  });

  const earth = scene.earth && toEarth(where);
  if (earth && dot(earth, away) <= 0) drawEarth();
  drawAxes(false);
  const along = turn(q, toBody(unit[model.long]));
  // Planes separate the parts, so that their order along the view is exact.
  const order = model.parts.slice().sort((a, b) => (a.centre - b.centre) * dot(along, away));
  for (const part of order) {
    for (const face of part.list) {
      const corners = face.points.map((p) => turn(q, toBody(p)));
      const normal = cross(plus(corners[1], corners[0], -1), plus(corners[2], corners[0], -1));
      const size = Math.hypot(...normal);
      if (size === 0 || dot(normal, away) <= 0) continue;
      pen.beginPath();
      corners.forEach((p) => pen.lineTo(...flat(p)));
      pen.closePath();
      pen.fillStyle = shade(face.colour, 0.62 + 0.5 * Math.max(0, dot(normal, lamp) / size));
      pen.fill();
      pen.strokeStyle = "rgba(10, 14, 22, 0.65)";
      pen.lineWidth = 1;
      pen.lineJoin = "round";
      pen.stroke();
      if (part.kind === "panel" && face.axis === part.thin) cells(corners, face, part);
    }
  }
  drawAxes(true);
  if (earth && dot(earth, away) > 0) drawEarth();
  unit.forEach((e, i) => label(e.map((c) => 1.24 * c), `${names[i]}*`, colours[i], "italic"));

  // The arrow starts at the edge of the central area and is longer than the axes, along which it may run.
  function drawEarth() {
    const colour = css("--soft");
    const [root, tip] = [1.5, 1.66].map((far) => earth.map((c) => far * c));
    line(root, tip, colour, 2, []);
    const [x2, y2] = flat(tip);
    const [ux, uy] = arrowHead(pen, flat(root), [x2, y2], colour, 6, 4);
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = colour;
    // Labels stay within the view, however narrow it is.
    const half = pen.measureText(scene.centre).width / 2 + 3;
    const middle = Math.min(Math.max(x2 + 28 * ux, half), width - half);
    pen.fillText(scene.centre, middle, y2 + 15 * uy);
  }

  // Solar cells, five along the panel and three across.
  function cells(c, face, part) {
    const first = face.way > 0 ? (face.axis + 1) % 3 : (face.axis + 2) % 3;
    const counts = first === part.long ? [5, 3] : [3, 5];
    const point = (a, b, s) => plus(a.map((v) => v * (1 - s)), b, s);
    for (let n = 1; n < counts[0]; n++) {
      line(point(c[0], c[1], n / counts[0]), point(c[3], c[2], n / counts[0]), "rgba(200, 215, 255, 0.45)", 0.8, []);
    }
    for (let n = 1; n < counts[1]; n++) {
      line(point(c[0], c[3], n / counts[1]), point(c[1], c[2], n / counts[1]), "rgba(200, 215, 255, 0.45)", 0.8, []);
    }
  }
}

// The distance from the centre at which a body axis leaves the outline.
function reach(i) {
  const e = [0, 1, 2].map((k) => scene.axes[i][k]);
  return Math.min(...e.map((c, k) => scene.size[k] / Math.max(Math.abs(c), 1e-9)));
}

const repaint = startShow(views, paint, (time) => `${time.toFixed(scene.digits)} s`);
