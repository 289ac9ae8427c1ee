// The craft near the libration point, one view per law: its path, the target circle, and the control as an arrow.
"use strict";

const TAIL = 160;
const views = [...document.querySelectorAll(".view")].map((box, law) => ({
  canvas: box.querySelector("canvas"), away: box.querySelector("output"), path: scene.paths[law], colour: report.laws[law].colour,
}));
eye.around = -0.62;
eye.above = 0.36;

function paint(view, where) {
  const { pen, width, height } = cleared(view.canvas);
  const { right, up } = stance();
  const frames = view.path.place.length;
  const at = Math.min(Math.round(where), frames - 1);
  const distance = view.path.away[at];
  view.away.textContent = where > frames - 1 ? "lost" : `${distance >= 100 ? distance.toFixed(0) : distance.toPrecision(3)} km`;

  const scale = Math.min(width, height) * 0.40 / scene.size;
  const flat = (p) => [width / 2 + scale * dot(p, right), height / 2 - scale * dot(p, up)];
  function stroke(points, colour, thick, dash = [], alpha = 1) {
    pen.beginPath();
    points.forEach((p) => pen.lineTo(...flat(p)));
    pen.setLineDash(dash);
    pen.globalAlpha = alpha;
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.lineJoin = "round";
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }
  function word(p, text, colour, align) {
    // In a small picture labels would cover the path.
    if (width < 200 || height < 160) return;
    const [x, y] = flat(p);
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = colour;
    pen.textAlign = align;
    pen.textBaseline = "top";
    pen.fillText(text, x, y + 4);
  }
  const soft = css("--soft");
  const far = 1.15 * scene.size;
  stroke([[-far, 0, 0], [far, 0, 0]], soft, 1);
  word([-far, 0, 0], "to the bodies", soft, "center");
  word([0, 1.12 * scene.size, 0], "y", css("--axis-y"), "center");
  word([0, 0, 1.12 * scene.size], "z", css("--axis-z"), "center");
  stroke([[0, -far, 0], [0, far, 0]], css("--line"), 1);
  stroke([[0, 0, -far], [0, 0, far]], css("--line"), 1);
  const [x0, y0] = flat([0, 0, 0]);
  pen.strokeStyle = css("--ink");
  pen.lineWidth = 1.6;
  pen.beginPath();
  pen.moveTo(x0 - 4, y0 - 4); pen.lineTo(x0 + 4, y0 + 4);
  pen.moveTo(x0 - 4, y0 + 4); pen.lineTo(x0 + 4, y0 - 4);
  pen.stroke();
  for (const radius of scene.rings) {
    const round = [...Array(121).keys()].map((i) => [0, radius * Math.cos(i * Math.PI / 60), radius * Math.sin(i * Math.PI / 60)]);
    stroke(round, soft, 1.2, [5, 4]);
  }
  stroke(view.path.place, view.colour, 1, [], 0.25);
  const past = view.path.place.slice(0, at + 1);
  stroke(past, view.colour, 1, [], 0.35);
  stroke(past.slice(-TAIL), view.colour, 2.4);
  const here = mix(view.path.place, where);
  const push = mix(view.path.push, where);
  const tip = plus(here, push, 0.35 * scene.size / scene.strongest);
  stroke([here, tip], css("--ink"), 1.6);
  arrowHead(pen, flat(here), flat(tip), css("--ink"), 5, 6);
  pen.beginPath();
  pen.arc(...flat(here), 5, 0, 7);
  pen.fillStyle = view.colour;
  pen.fill();
  pen.strokeStyle = css("--card");
  pen.lineWidth = 1.2;
  pen.stroke();
}

startShow(views, paint, (days) => (days >= 1000 ? `${(days / 365.25).toFixed(2)} years` : `${days.toFixed(1)} days`));
