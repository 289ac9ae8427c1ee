// Draws the plots over time with uPlot, in the colours of the page: fast enough to follow a slider.
"use strict";

const charts = new Map();
const hidden = new Set();
let colours = {};
// If a run is much longer than its transient, a switch on the page selects the whole run or the transient.
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

// --- units to suit the numbers ---

const SPANS = [[172800, 86400, "days"], [7200, 3600, "h"], [600, 60, "min"], [0, 1, "s"]];

// The unit of a plot's time axis, and its length in units of the clock.
function clockOf(plot) {
  if (plot.clock !== "s") return [1, plot.clock];
  const times = timesOf(plot);
  return SPANS.find(([least]) => times[times.length - 1] >= least).slice(1);
}

const PREFIXES = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 3: "k", 6: "M" };

// The divisor of a panel's numbers, and the label that goes with it.
function unitOf(panel, u) {
  const [, name, unit] = panel.label.match(/^(?:(.*), )?(.*)$/);
  const written = (text) => [name, text === "1" ? "" : text.replace("^2", "²").replace("^3", "³")].filter(Boolean).join(", ");
  const most = Math.max(Math.abs(u.scales.y.min), Math.abs(u.scales.y.max));
  const power = 3 * Math.floor(Math.log10(most) / 3 + 1e-9);
  if (panel.log || !Number.isFinite(power) || (most >= 0.01 && most < 1e4)) return { factor: 1, label: written(unit) };
  const prefix = PREFIXES[power];
  if (prefix && /^(N|A|T|W|J|V|rad)\b/.test(unit)) return { factor: 10 ** power, label: written(prefix + unit) };
  return { factor: 10 ** power, label: `${written(unit)} ×10${superscript(power)}` };
}

// Arranges the labels of marks above a plot in rows without overlaps; "" for a label without room.
const WORD_ROWS = 3, WORD_HEIGHT = 13;
function placedWords(marks, place, measure) {
  const ends = Array(WORD_ROWS).fill(-Infinity);
  return marks.map(([time, word]) => {
    const x = place(time), row = ends.findIndex((end) => x >= end);
    if (row >= 0 && word) ends[row] = x + measure(word) + 8;
    return { x, word: row < 0 ? "" : word, row };
  });
}

// Rounds a number down or up to 1, 2 or 5 times a power of ten.
function rounded(value, way) {
  const power = 10 ** Math.floor(Math.log10(value)), digits = [1, 2, 5, 10];
  const share = value / power;
  return power * (way === Math.floor ? digits.findLast((d) => d <= share * (1 + 1e-9)) : digits.find((d) => d >= share * (1 - 1e-9)));
}

// The range of ordinates: that of visible laws that did not diverge, and of the levels.
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
  // A level extends an axis only if it is near the curves; a more distant limit is given in words.
  const [under, over] = panel.log ? [low / 100, high * 100] : [2 * low - high, 2 * high - low];
  for (const level of panel.levels) {
    if (level >= under && level <= over) [low, high] = [Math.min(low, level), Math.max(high, level)];
  }
  if (low > high) return panel.log ? [0.1, 1] : [0, 1];
  // Below this share of the largest value lies rounding, and more decades than there is room for.
  if (panel.log) low = Math.max(low, 1e-15 * high);
  if (panel.log) return [rounded(low, Math.floor), rounded(high, Math.ceil)];
  if (low === high) return [low - 1, high + 1];
  return uPlot.rangeNum(chart.plot.split ? 0 : low, high, 0.08, true);
}

const TINTS = ["79,70,229,.10", "245,158,11,.14", "16,185,129,.13", "100,116,139,.15", "236,72,153,.10", "14,165,233,.13"];
const bands = report.bands || [];
const modes = [...new Set(bands.map(([, , name]) => name))];
const tint = (name) => `rgba(${TINTS[modes.indexOf(name) % TINTS.length]})`;

// Modes as bands of time, behind the curves.
function tinted(u) {
  const { ctx, bbox, scales: { x } } = u;
  ctx.save();
  for (const [start, end, name] of bands) {
    const [from, to] = [Math.max(start, x.min), Math.min(end, x.max)].map((time) => u.valToPos(time, "x", true));
    if (to <= from) continue;
    ctx.fillStyle = tint(name);
    ctx.fillRect(from, bbox.top, to - from, bbox.height);
  }
  ctx.restore();
}

// Dashed levels, dotted lines where something happens, and the words above a panel.
function guides(panel, plot, chart) {
  return (u) => {
    const { ctx, bbox, scales: { x, y } } = u;
    const dot = devicePixelRatio, right = bbox.left + bbox.width;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = colours.soft;
    ctx.lineWidth = dot;
    const line = (from, to, dash) => {
      ctx.setLineDash(dash.map((d) => d * dot));
      ctx.beginPath();
      ctx.moveTo(...from);
      ctx.lineTo(...to);
      ctx.stroke();
    };
    for (const level of panel.levels) {
      const high = u.valToPos(level, "y", true);
      line([bbox.left, high], [right, high], [6, 4]);
    }
    // A strip at the bottom marks where the estimate is not valid, in the flight of the file.
    ctx.fillStyle = colours.soft;
    for (const [start, end] of chart.live ? [] : report.unsure || []) {
      const [from, to] = [Math.max(start, x.min), Math.min(end, x.max)].map((time) => u.valToPos(time, "x", true));
      if (to <= from || plot.split) continue;
      ctx.fillRect(from, bbox.top + bbox.height - 4 * dot, to - from, 4 * dot);
      // The label stays inside the plot.
      ctx.textAlign = from > bbox.left + bbox.width / 2 ? "right" : "left";
      ctx.fillText("estimate not valid", ctx.textAlign === "left" ? from : to, bbox.top + bbox.height - 7 * dot);
    }
    // Proved bounds are about the flight of the file.
    for (const [number, times, most] of chart.live ? [] : panel.bounds || []) {
      if (hidden.has(number)) continue;
      ctx.strokeStyle = report.laws[number].colour;
      times.slice(0, -1).forEach((time, k) => {
        const [from, until] = [time, times[k + 1]].map((t) => u.valToPos(t, "x", true));
        const [high, next] = [most[k], most[k + 1]].map((angle) => u.valToPos(angle, "y", true));
        line([from, high], [until, high], [6, 4]);
        line([until, high], [until, next], [6, 4]);
      });
    }
    ctx.font = `${11 * dot}px system-ui, sans-serif`;
    const inside = (report.marks || []).filter(([time]) => time >= x.min && time <= x.max);
    const words = plot.split ? [] : placedWords(inside, (time) => u.valToPos(time, "x", true), (word) => ctx.measureText(word).width);
    for (const { x: place } of words) line([place, bbox.top], [place, bbox.top + bbox.height], [2, 3]);
    ctx.restore();
    ctx.save();
    ctx.fillStyle = colours.ink;
    ctx.textBaseline = "alphabetic";
    ctx.textAlign = "left";
    ctx.font = `${12 * dot}px system-ui, sans-serif`;
    const { factor, label } = unitOf(panel, u), top = bbox.top - 6 * dot - wordsAbove(plot, panel) * dot;
    ctx.fillText(label, bbox.left, top);
    ctx.fillStyle = colours.soft;
    ctx.textAlign = "right";
    const sizes = [...new Set(panel.levels.map(Math.abs))], off = panel.levels.some((level) => level < y.min || level > y.max);
    const both = panel.levels.length > sizes.length ? "±" : "";
    const room = right - bbox.left + 20 * dot - ctx.measureText(label).width;
    const told = sizes.map((size) => `– – ${both}${short(size / factor, 3)}${off ? ", off the scale" : ""}`).join("  ");
    if (ctx.measureText(told).width < room) ctx.fillText(told, right, top);
    if (wordsAbove(plot, panel)) {
      ctx.font = `${11 * dot}px system-ui, sans-serif`;
      ctx.textAlign = "center";
      for (const [start, end, name] of bands) {
        const [from, to] = [Math.max(start, x.min), Math.min(end, x.max)].map((time) => u.valToPos(time, "x", true));
        if (to - from > ctx.measureText(name).width + 4 * dot) ctx.fillText(name, 0.5 * (from + to), bbox.top - 4 * dot);
      }
      ctx.textAlign = "left";
      for (const { x: place, word, row } of words) {
        const most = right + 20 * dot - ctx.measureText(word).width;
        ctx.fillText(word, Math.min(place, most), bbox.top - (4 + (row + Boolean(bands.length)) * WORD_HEIGHT) * dot);
      }
    }
    ctx.restore();
  };
}

// Shows the values under the pointer in the corner of each panel, and a line at the time that the views show.
function readout(panel, k, chart) {
  const box = document.createElement("div"), line = document.createElement("i");
  box.className = "readout";
  box.hidden = true;
  line.className = "moment";
  return {
    hooks: {
      init: (u) => {
        u.over.append(box);
        if (!chart.plot.split) u.over.append(line);
        u.atMoment = () => {
          const { min, max } = u.scales.x;
          line.hidden = moment === null || moment < min || moment > max;
          if (!line.hidden) line.style.left = `${u.valToPos(moment, "x")}px`;
        };
      },
      draw: (u) => u.atMoment(),
      setCursor: (u) => {
        const { idx } = u.cursor;
        box.hidden = !chart.seen || idx === null || idx === undefined;
        if (box.hidden) return;
        const time = u.data[0][idx], { factor } = unitOf(panel, u), [size, unit] = chart.plot.split ? [1, ""] : clockOf(chart.plot);
        if (!chart.plot.split && u.over.matches(":hover")) document.dispatchEvent(new CustomEvent("looked-at", { detail: time }));
        const parts = panel.order.map((number, place) => [number, u.data[1 + place][idx]])
          .filter(([number]) => !hidden.has(number)).sort((a, b) => a[0] - b[0]);
        box.innerHTML = (k === 0 ? `<b>${short(time / size, 5)} ${unit}</b>` : "")
          + parts.map(([number, value]) => `<span style="color:${report.laws[number].colour}">${short(value === null ? value : value / factor)}</span>`).join("");
      },
    },
  };
}

let moment = null;
document.addEventListener("moment", ({ detail }) => {
  moment = detail;
  for (const chart of charts.values()) if (chart.seen && !chart.plot.split) chart.panels.forEach((u) => u.atMoment());
});

const STEPS = [1, 2, 2.5, 5].flatMap((x) => [-3, -2, -1, 0, 1, 2, 3, 4].map((power) => x * 10 ** power)).sort((a, b) => a - b);

function options(plot, panel, k, chart, size) {
  const bottom = plot.split || k === plot.panels.length - 1;
  const grid = { stroke: () => colours.line, width: 1 };
  const axis = { stroke: () => colours.ink, grid, ticks: { show: false }, font: "12px system-ui, sans-serif", labelFont: "12.5px system-ui, sans-serif" };
  const [tick, unit] = plot.split ? [1, ""] : clockOf(plot);
  const told = plot.split ? { space: 50, label: plot.xlabel, incrs: [1], values: (u, splits) => splits }
    : { space: 75, label: `time, ${unit}`, incrs: STEPS.map((step) => step * tick), values: (u, splits) => splits.map((v) => short(v / tick, 6)) };
  return {
    ...size, plugins: [readout(panel, k, chart)], legend: { show: false }, padding: [22 + wordsAbove(plot, panel), 16, 0, 0],
    cursor: { sync: { key: plot.split ? `${plot.name}${k}` : "time", setSeries: false }, drag: { x: true, y: false }, points: { size: 6 } },
    scales: {
      x: { time: false, ...(plot.split ? { range: [0.8, 6.2] } : {}) },
      y: { distr: panel.log ? 3 : 1, range: (u) => span(panel, chart, u) },
    },
    axes: [
      bottom ? { ...axis, ...told, size: 26, labelSize: 18 } : { ...axis, ...told, label: undefined, size: 6, values: (u, splits) => splits.map(() => "") },
      {
        ...axis, size: 50, ...(panel.log ? { grid: { ...grid, filter: decades } } : {}),
        ...(panel.log ? { values: powersOfTen, filter: decades }
          : { values: (u, splits) => splits.map((v) => (v === null ? "" : short(v / unitOf(panel, u).factor, 6))) }),
      },
    ],
    series: [{}, ...panel.order.map((number) => ({
      stroke: report.laws[number].colour, width: panel.widths[number], show: !hidden.has(number),
      points: { show: Boolean(plot.markers), size: 8, fill: report.laws[number].colour },
    }))],
    hooks: { drawAxes: plot.split ? [] : [tinted], draw: [guides(panel, plot, chart)] },
  };
}

// Powers of ten are written as decimals if the axis has none too small for that.
function powersOfTen(u, splits) {
  const { min, max } = u.scales.y;
  return splits.map((v) => {
    if (v === null || !nearlyWhole(Math.log10(v))) return "";
    return min >= 0.9e-4 && max <= 1.1e5 ? String(Number(v.toPrecision(1))) : `10${superscript(Math.round(Math.log10(v)))}`;
  });
}

// Labels as many powers of ten as there is room for.
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

// The room for words above the first panel of a plot.
function wordsAbove(plot, panel) {
  if (plot.split || panel !== plot.panels[0]) return 0;
  const rows = (report.marks || []).length ? Math.min(WORD_ROWS, report.marks.length) : 0;
  return (rows + Boolean(bands.length)) * WORD_HEIGHT;
}

function sizes(plot, box) {
  const room = box.clientWidth || document.body.clientWidth - 80, lead = plot.name === report.plots[0].name;
  const width = Math.floor(plot.split && room > 700 ? room / 2 : room);
  const high = lead ? box.clientHeight - box.querySelector(".legend-row").offsetHeight : plot.panels.length === 1 || plot.split ? 230 : 130;
  return plot.panels.map((panel, k) => ({
    width, height: lead ? Math.max(high, 120) : high + wordsAbove(plot, panel) + (plot.split || k === plot.panels.length - 1 ? 44 : 0),
  }));
}

function legend(plot) {
  const laws = report.laws.map((law, number) => `<button type="button" class="law-name" data-law="${number}" `
    + `title="click: hide; double click: alone"><i style="background:${law.colour}"></i>${plain(law.name)}</button>`);
  const keys = modes.map((name) => `<span class="mode"><i style="background:${tint(name)}"></i>${plain(name)}</span>`);
  return `<div class="legend-row">${(laws.length > 1 ? laws : []).concat(plot.name === report.plots[0].name ? keys : []).join("")}</div>`;
}

// Makes the panels of a plot; later flights change only their data.
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

// Sets the curves of a law in a plot to those of its last flight.
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

// Draws the changes by `setCurves`; the reader's zoom is kept.
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
  // A double click shows this law alone, or all.
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

// Plot and body take the space that the rest of the first screen leaves.
const lead = document.querySelector(".two, .one");
const measureAbove = () => document.documentElement.style.setProperty("--above", `${lead.getBoundingClientRect().top + scrollY}px`);
if (lead) {
  measureAbove();
  new ResizeObserver(measureAbove).observe(document.body);
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
    if (chart.box.clientWidth) chart.panels.forEach((u, k) => { if (u.width !== measures[k].width || u.height !== measures[k].height) u.setSize(measures[k]); });
  }
});
// A plot out of sight is drawn when it comes into sight.
const sight = new IntersectionObserver((entries) => {
  for (const entry of entries) charts.get(entry.target.id).seen = entry.isIntersecting;
  document.dispatchEvent(new Event("plots-seen"));
});
charts.forEach((chart) => { fit.observe(chart.box); sight.observe(chart.box); });
