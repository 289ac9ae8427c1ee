// Shared by the three-dimensional views: vectors, the viewpoint, and the player that runs through a scene.
"use strict";

const scene = report.scene;
const last = scene.times.length - 1;
// The viewpoint as azimuth about the third axis and elevation; dragging changes both.
const eye = { around: -0.9, above: 0.42 };

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];

// Interpolates between the rows of two frames.
function mix(rows, where) {
  const k = Math.min(Math.floor(where), rows.length - 1);
  const next = rows[Math.min(k + 1, rows.length - 1)];
  const s = Math.min(where - k, 1);
  return rows[k].map((c, i) => (1 - s) * c + s * next[i]);
}

// Draws the head of an arrow between two points of the canvas, unless it is shorter than `least`; returns its direction.
function arrowHead(pen, [x1, y1], [x2, y2], colour, ahead, least) {
  const long = Math.hypot(x2 - x1, y2 - y1);
  const [ux, uy] = long > 0 ? [(x2 - x1) / long, (y2 - y1) / long] : [0, 1];
  if (long > least) {
    pen.beginPath();
    pen.moveTo(x2 + ahead * ux, y2 + ahead * uy);
    pen.lineTo(x2 - 4 * uy, y2 + 4 * ux);
    pen.lineTo(x2 + 4 * uy, y2 - 4 * ux);
    pen.closePath();
    pen.fillStyle = colour;
    pen.fill();
  }
  return [ux, uy];
}

// The directions towards, right and up as seen by the reader.
function stance() {
  const away = [Math.cos(eye.above) * Math.cos(eye.around), Math.cos(eye.above) * Math.sin(eye.around), Math.sin(eye.above)];
  const right = [-Math.sin(eye.around), Math.cos(eye.around), 0];
  return { away, right, up: cross(away, right) };
}

// Clears a canvas and matches its pixels to those of the screen.
function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

function timeAt(where) {
  const k = Math.min(Math.floor(where), last - 1);
  return scene.times[k] + (where - k) * (scene.times[k + 1] - scene.times[k]);
}

// Slider, button and clock; `paint(view, where)` draws a view at a (fractional) frame. Returns a function that repaints.
function startShow(views, paint, timeText) {
  const slider = document.getElementById("moment");
  const clock = document.getElementById("clock");
  const button = document.getElementById("play");
  let place = 0;
  let playing = false;

  function show(where) {
    place = Math.max(0, Math.min(last, where));
    slider.value = place;
    const text = timeText(timeAt(place));
    clock.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    views.forEach((view) => paint(view, place));
    document.dispatchEvent(new CustomEvent("moment", { detail: timeAt(place) / (scene.tick || 1) }));
  }

  // The frame at a time, which may be fractional.
  function frameAt(time) {
    const k = Math.max(0, Math.min(last - 1, scene.times.findIndex((other) => other > time) - 1));
    return time >= scene.times[last] ? last : k + (time - scene.times[k]) / (scene.times[k + 1] - scene.times[k]);
  }

  function play(on) {
    if (on && !playing && place >= last) place = 0;
    playing = on;
    button.textContent = on ? "Pause" : "Play";
    if (!on) return;
    let before = null;
    const tick = (now) => {
      if (!playing) return;
      if (before !== null) show(place + (now - before) * last / (scene.seconds * 1000));
      before = now;
      if (place >= last) play(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  slider.max = last;
  slider.addEventListener("input", () => { play(false); show(Number(slider.value)); });
  button.addEventListener("click", () => play(!playing));
  document.addEventListener("looked-at", ({ detail }) => { if (!playing) show(frameAt(detail * (scene.tick || 1))); });
  for (const { canvas } of views) {
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      eye.around -= 0.01 * event.movementX;
      eye.above = Math.max(-1.5, Math.min(1.5, eye.above + 0.01 * event.movementY));
      show(place);
    });
  }
  new ResizeObserver(() => show(place)).observe(views[0].canvas);
  dark.addEventListener("change", () => show(place));
  show(Number(slider.value));
  return () => show(place);
}
