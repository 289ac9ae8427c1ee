// Draws the plots over time with uPlot, in the colours of the page: fast enough to follow a slider.
"use strict";

const charts = new Map();
const hidden = new Set();
let colours = {};
// Of a run that is long beside its transient both can be seen; the page has a switch.
let transient = false;

function readColours() {
  colours = Object.fromEntries(["ink", "soft", "line", "card"].map((name) => [name, css(`--${name}`)]));
}

const shownNow = (plot) => (transient && report.transient && report.transient.plots[plot.name]) || plot;
const timesOf = (plot) => plot.x || (transient && report.transient ? report.transient.times : report.times);
const superscript = (n) => String(n).replace(/[-0-9]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
const nearlyWhole = (x) => Math.abs(x - Math.round(x)) < 1e-9;

function short(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size === 0 || (size >= 1e-3 && size < 1e5)) return String(Number(value.toPrecision(digits))).replace("-", "−");
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  return `${Number(mantissa)}×10${superscript(Number(power))}`.replace("-", "−");
}

// Where the words of marks stand above a plot: rows of which none overlaps another; "" for what has no room.
const WORD_ROWS = 3, WORD_HEIGHT = 13;
function placedWords(marks, place, measure) {
  const ends = Array(WORD_ROWS).fill(-Infinity);
  return marks.map(([time, word]) => {
    const x = place(time), row = ends.findIndex((end) => x >= end);
    if (row >= 0 && word) ends[row] = x + measure(word) + 8;
    return { x, word: row < 0 ? "" : word, row };
  });
}

// The ordinates to show: of laws that are shown and were not lost, with the levels.
function span(panel, chart, u) {
  if (panel.span && !chart.live) return panel.span;
  const [first, last] = u.series[0].idxs || [0, u.data[0].length - 1];
  let low = Infinity, high = -Infinity;
  const numbers = panel.order.filter((number) => !hidden.has(number));
  const sound = numbers.filter((number) => !chart.lost.has(number));
  for (const number of sound.length ? sound : numbers) {
    const values = u.data[1 + panel.order.indexOf(number)];
    for (let k = first; k <= last; k++) {
      const value = values[k];
      if (value === null || value === undefined) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  for (const level of panel.levels) {
    low = Math.min(low, level);
    high = Math.max(high, level);
  }
  if (low > high) return panel.log ? [0.1, 1] : [0, 1];
  // Below this share of the largest there is rounding, and more decades than there is room for.
  if (panel.log) low = Math.max(low, 1e-15 * high);
  if (panel.log) return [10 ** Math.floor(Math.log10(low) - 1e-9), 10 ** Math.ceil(Math.log10(high) + 1e-9)];
  if (low === high) return [low - 1, high + 1];
  return uPlot.rangeNum(chart.plot.split ? 0 : low, high, 0.08, true);
}

// Dashed levels, and dotted lines where something happens.
function guides(panel, plot) {
  return (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = colours.soft;
    ctx.lineWidth = devicePixelRatio;
    const line = (from, to, dash) => {
      ctx.setLineDash(dash.map((d) => d * devicePixelRatio));
      ctx.beginPath();
      ctx.moveTo(...from);
      ctx.lineTo(...to);
      ctx.stroke();
    };
    for (const level of panel.levels) {
      const y = u.valToPos(level, "y", true);
      line([bbox.left, y], [bbox.left + bbox.width, y], [6, 4]);
    }
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    const inside = (plot.marks || []).filter(([time]) => time >= u.scales.x.min && time <= u.scales.x.max);
    const words = placedWords(inside, (time) => u.valToPos(time, "x", true), (word) => ctx.measureText(word).width);
    for (const { x } of words) line([x, bbox.top], [x, bbox.top + bbox.height], [2, 3]);
    ctx.restore();
    if (panel !== plot.panels[0]) return;
    ctx.save();
    ctx.fillStyle = colours.soft;
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    for (const { x, word, row } of words) {
      const room = bbox.left + bbox.width + 20 * devicePixelRatio - ctx.measureText(word).width;
      ctx.fillText(word, Math.min(x, room), bbox.top - (4 + row * WORD_HEIGHT) * devicePixelRatio);
    }
    ctx.restore();
  };
}

// The values under the pointer, in the corner of each panel.
function readout(panel, k, chart) {
  const box = document.createElement("div");
  box.className = "readout";
  return {
    hooks: {
      init: (u) => u.over.append(box),
      setCursor: (u) => {
        const { idx } = u.cursor;
        box.hidden = idx === null || idx === undefined;
        if (box.hidden) return;
        const parts = panel.order.map((number, place) => [number, u.data[1 + place][idx]])
          .filter(([number]) => !hidden.has(number)).sort((a, b) => a[0] - b[0]);
        box.innerHTML = (k === 0 ? `<b>${short(u.data[0][idx], 5)}</b>` : "")
          + parts.map(([number, value]) => `<span style="color:${report.laws[number].colour}">${short(value)}</span>`).join("");
      },
    },
  };
}

function options(plot, panel, k, chart, size) {
  const bottom = plot.split || k === plot.panels.length - 1;
  const grid = { stroke: () => colours.line, width: 1 };
  const axis = { stroke: () => colours.ink, grid, ticks: { show: false }, font: "12px system-ui, sans-serif", labelFont: "12.5px system-ui, sans-serif" };
  return {
    ...size, plugins: [readout(panel, k, chart)], legend: { show: false }, padding: [k === 0 ? 8 + wordsAbove(plot) : 8, 22, 0, 0],
    cursor: { sync: { key: plot.split ? `${plot.name}${k}` : plot.name, setSeries: false }, drag: { x: true, y: false }, points: { size: 6 } },
    scales: {
      x: { time: false, ...(plot.split ? { range: [0.8, 6.2] } : {}) },
      y: { distr: panel.log ? 3 : 1, range: (u) => span(panel, chart, u) },
    },
    axes: [
      bottom ? { ...axis, label: plot.xlabel, size: 30, labelSize: 20, ...(plot.split ? { incrs: [1] } : {}) }
        : { ...axis, size: 6, values: (u, splits) => splits.map(() => "") },
      {
        ...axis, label: panel.label, size: 58, labelSize: 20, ...(panel.log ? { grid: { ...grid, filter: decades } } : {}),
        ...(panel.log ? {
          values: (u, splits) => splits.map((v) => (v !== null && nearlyWhole(Math.log10(v)) ? `10${superscript(Math.round(Math.log10(v)))}` : "")),
          filter: decades,
        } : { values: (u, splits) => splits.map((v) => (v === null ? "" : short(v, 6))) }),
      },
    ],
    series: [{}, ...panel.order.map((number) => ({
      stroke: report.laws[number].colour, width: panel.widths[number], show: !hidden.has(number),
      points: { show: Boolean(plot.markers), size: 8, fill: report.laws[number].colour },
    }))],
    hooks: { draw: [guides(panel, plot)] },
  };
}

// Of powers of ten as many as there is room for.
function decades(u, splits) {
  const powers = splits.filter((v) => v !== null && nearlyWhole(Math.log10(v)));
  const every = Math.ceil(powers.length / Math.max(2, u.height / 34));
  return splits.map((v) => (v !== null && nearlyWhole(Math.log10(v)) && Math.round(Math.log10(v)) % every === 0 ? v : null));
}

const gaps = (values, count, log) => Array.from({ length: count }, (_, k) => {
  const value = values[k];
  return value === undefined || value === null || !Number.isFinite(value) || (log && value <= 0) ? null : value;
});

function dataOf(plot, panel) {
  const times = timesOf(plot);
  return [times, ...panel.order.map((number) => gaps(panel.curves[number], times.length, panel.log))];
}

const wordsAbove = (plot) => ((plot.marks || []).some(([, word]) => word) ? WORD_ROWS * WORD_HEIGHT : 0);

function sizes(plot, box) {
  const rows = plot.split ? 1 : plot.panels.length;
  const width = Math.floor(plot.split ? box.clientWidth / (box.clientWidth > 700 ? 2 : 1) : box.clientWidth);
  const high = rows === 1 ? 270 : rows === 2 ? 200 : 150;
  return plot.panels.map((_, k) => ({ width, height: high + (k === 0 ? wordsAbove(plot) : 0) + (plot.split || k === plot.panels.length - 1 ? 44 : 0) }));
}

function legend(plot) {
  return `<div class="legend-row">${report.laws.map((law, number) => `<button type="button" class="law-name" data-law="${number}">`
    + `<i style="background:${law.colour}"></i>${plain(law.name)}</button>`).join("")}</div>`;
}

// A plot's panels, made anew; what flies again changes their data afterwards.
function draw(plot) {
  const box = document.getElementById(plot.name);
  const before = charts.get(plot.name);
  if (before) before.panels.forEach((u) => u.destroy());
  box.innerHTML = legend(plot);
  const place = document.createElement("div");
  place.className = plot.split ? "panels split" : "panels";
  box.append(place);
  const chart = { plot, box, panels: [], live: false, lost: before ? before.lost : new Set(), seen: before ? before.seen : true };
  charts.set(plot.name, chart);
  const measures = sizes(plot, box);
  chart.panels = plot.panels.map((panel, k) => new uPlot(options(plot, panel, k, chart, measures[k]), dataOf(plot, panel), place));
}

// A law's curves of a plot as they were flown last.
function setCurves(name, number, curves, lost) {
  const chart = charts.get(name);
  chart.live = true;
  if (lost) chart.lost.add(number); else chart.lost.delete(number);
  chart.panels.forEach((u, k) => {
    const panel = chart.plot.panels[k];
    u.data[1 + panel.order.indexOf(number)] = gaps(curves[k], u.data[0].length, panel.log);
  });
  chart.changed = true;
}

// Draws what `setCurves` changed; where the reader has zoomed in, the zoom stays.
function redrawChanged() {
  for (const chart of charts.values()) {
    if (!chart.changed) continue;
    chart.changed = false;
    for (const u of chart.panels) {
      const { min, max } = u.scales.x;
      const all = min === u.data[0][0] && max === u.data[0][u.data[0].length - 1];
      u.setData(u.data, all || Boolean(chart.plot.split));
      if (!all && !chart.plot.split) u.redraw(true, false);
    }
  }
}

function drawAll() {
  readColours();
  report.plots.filter((plot) => !plot.planes).map(shownNow).forEach(draw);
  showHidden();
}

function showHidden() {
  for (const chart of charts.values()) {
    for (const button of chart.box.querySelectorAll(".law-name")) button.setAttribute("aria-pressed", String(!hidden.has(Number(button.dataset.law))));
    chart.panels.forEach((u, k) => chart.plot.panels[k].order.forEach((number, place) => {
      if (u.series[1 + place].show === hidden.has(number)) u.setSeries(1 + place, { show: !hidden.has(number) });
    }));
  }
}

document.addEventListener("click", (event) => {
  const button = event.target.closest(".law-name");
  if (!button) return;
  const number = Number(button.dataset.law);
  // A second click at once: this law alone, or all.
  if (event.detail === 2) {
    const alone = report.laws.every((_, other) => other === number || hidden.has(other));
    hidden.clear();
    if (!alone) report.laws.forEach((_, other) => other !== number && hidden.add(other));
  } else if (!hidden.delete(number)) hidden.add(number);
  showHidden();
});

if (report.transient) {
  const buttons = [document.getElementById("whole"), document.getElementById("transient-only")];
  buttons.forEach((button, one) => button.addEventListener("click", () => {
    transient = one === 1;
    buttons.forEach((other) => other.setAttribute("aria-pressed", String(other === button)));
    drawAll();
    document.dispatchEvent(new Event("plots-drawn"));
  }));
}

drawAll();
dark.addEventListener("change", () => {
  readColours();
  charts.forEach((chart) => chart.panels.forEach((u) => u.redraw(false, true)));
});
const fit = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    const chart = charts.get(target.id);
    const measures = sizes(chart.plot, chart.box);
    chart.panels.forEach((u, k) => { if (u.width !== measures[k].width) u.setSize(measures[k]); });
  }
});
// What is out of sight is drawn when it comes into sight.
const sight = new IntersectionObserver((entries) => {
  for (const entry of entries) charts.get(entry.target.id).seen = entry.isIntersecting;
  document.dispatchEvent(new Event("plots-seen"));
});
charts.forEach((chart) => { fit.observe(chart.box); sight.observe(chart.box); });
