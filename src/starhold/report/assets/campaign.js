// Draws the distributions and envelopes of a campaign with Plotly, in the colours of the page.
"use strict";

const hiddenLaws = new Set();
let rare = false;
const title = (text, standoff) => ({ text: plain(text), standoff, font: { size: 13 } });
const settings = (name) => ({
  responsive: true, displaylogo: false, displayModeBar: false, toImageButtonOptions: { filename: name, scale: 2 },
});

function faded(colour, opacity) {
  const part = (at) => parseInt(colour.slice(at, at + 2), 16);
  return `rgba(${part(1)},${part(3)},${part(5)},${opacity})`;
}

const shownCurves = (plot) => plot.curves.filter((curve) => !hiddenLaws.has(curve.law));

function smallest(values) {
  return Math.min(...values.filter((value) => value > 0));
}

// Plots side by side fill their boxes; a plot in a fold has no size until the fold is opened.
const box = (plot) => document.getElementById(plot.name);
const heightOf = (plot, otherwise) => (box(plot).closest(".two, .one") ? box(plot).clientHeight : otherwise);

function drawHistogram(plot) {
  if (!box(plot).clientWidth) return;
  const { axis, layout } = look();
  const curves = shownCurves(plot);
  // On a logarithmic scale bars start at the height of a single run, or at half of the lowest bar.
  const ground = rare ? 0.5 * smallest(plot.curves.flatMap((curve) => curve.values)) : 0;
  const traces = curves.flatMap((curve) => {
    const law = report.laws[curve.law];
    const x = [curve.edges[0]], y = [ground], middles = [], heights = [], told = [];
    curve.values.forEach((value, bin) => {
      const [low, high] = [curve.edges[bin], curve.edges[bin + 1]];
      x.push(low, high);
      y.push(Math.max(value, ground), Math.max(value, ground));
      if (value > 0) {
        middles.push(plot.log ? Math.sqrt(low * high) : 0.5 * (low + high));
        heights.push(value);
        told.push([low, high, curve.share[bin]]);
      }
    });
    x.push(curve.edges[curve.edges.length - 1]);
    y.push(ground);
    return [
      {
        type: "scatter", mode: "lines", x, y, fill: "toself", fillcolor: faded(law.colour, 0.22), hoverinfo: "skip",
        line: { color: law.colour, width: 1.5 },
      },
      {
        type: "scatter", mode: "markers", x: middles, y: heights, customdata: told, marker: { opacity: 0, color: law.colour },
        hovertemplate: `%{customdata[2]:.3~g} % of runs<br>from %{customdata[0]:.4~g} to %{customdata[1]:.4~g}<extra>${plain(law.name)}</extra>`,
      },
    ];
  });
  Object.assign(layout, {
    height: heightOf(plot, 250), margin: { l: 62, r: 14, t: 12, b: 44 }, hovermode: "closest", showlegend: false,
    xaxis: {
      ...axis, title: title(plot.xlabel, 8), nticks: 7, zeroline: false,
      ...(plot.log ? { type: "log", exponentformat: "power", dtick: decades(plot), tickfont: { size: 11 } } : {}),
    },
    yaxis: {
      ...axis, title: title(plot.ylabel, 6),
      ...(rare ? { type: "log", dtick: 1, exponentformat: "power", tickfont: { size: 11 } } : { rangemode: "tozero" }),
    },
    shapes: plot.levels.map((level) => ({
      type: "line", xref: "x", x0: level, x1: level, yref: "paper", y0: 0, y1: 1,
      line: { color: css("--ink"), width: 1.4, dash: "dash" },
    })),
  });
  // Shapes do not extend an axis, so an invisible point does.
  if (plot.levels.length) {
    traces.push({ type: "scatter", mode: "markers", x: plot.levels, y: plot.levels.map(() => ground || 0), marker: { opacity: 0 }, hoverinfo: "skip" });
  }
  Plotly.react(plot.name, traces, layout, settings(plot.name));
}

// Ticks stand at powers of ten if the bins span several of them, otherwise where Plotly puts them.
function decades(plot) {
  const ends = plot.curves.flatMap((curve) => [curve.edges[0], curve.edges[curve.edges.length - 1]]);
  const span = Math.log10(Math.max(...ends) / Math.min(...ends));
  return span > 2 ? Math.max(1, Math.ceil(span / 5)) : undefined;
}

// A value holds for the window that ends at its time: returns the corners of these steps in order of time.
function corners(times, values) {
  const x = [], y = [];
  times.forEach((time, k) => {
    x.push(k ? times[k - 1] : 0, time);
    y.push(values[k], values[k]);
  });
  return [x, y];
}

function bands(curve, plot) {
  // Each piece between gaps runs forward along the top and back along the bottom.
  const ground = plot.log ? 10 ** plot.span[0] : -Infinity;
  const [x, high] = corners(curve.times, curve.high);
  const low = corners(curve.times, curve.low)[1];
  const xs = [], ys = [];
  for (let start = 0; start < x.length; start += 1) {
    if (high[start] === null || high[start] < ground) continue;
    let end = start;
    while (end < x.length && high[end] !== null && high[end] >= ground) end += 1;
    for (let k = start; k < end; k += 1) { xs.push(x[k]); ys.push(high[k]); }
    for (let k = end - 1; k >= start; k -= 1) { xs.push(x[k]); ys.push(Math.max(low[k], ground)); }
    xs.push(null);
    ys.push(null);
    start = end - 1;
  }
  return [xs, ys];
}

function drawEnvelope(plot) {
  if (!box(plot).clientWidth) return;
  const { axis, layout } = look();
  const curves = shownCurves(plot);
  // The first window begins at the start.
  const whole = (values) => [values[0], ...values];
  const since = (curve) => [0, ...curve.times];
  const positive = (values) => whole(plot.log ? values.map((value) => (value > 0 ? value : null)) : values);
  const behind = curves.map((curve) => {
    const [x, y] = bands(curve, plot);
    return {
      type: "scatter", mode: "lines", x, y, fill: "toself", fillcolor: faded(report.laws[curve.law].colour, 0.2),
      line: { width: 0 }, hoverinfo: "skip",
    };
  });
  const thin = curves.flatMap((curve) => ["least", "most"].map((key) => ({
    type: "scatter", mode: "lines", x: since(curve), y: positive(curve[key]), hoverinfo: "skip",
    line: { color: faded(report.laws[curve.law].colour, 0.6), width: 0.8, shape: "vh" },
  })));
  const medians = curves.map((curve) => {
    const law = report.laws[curve.law];
    return {
      type: "scatter", mode: "lines", x: since(curve), y: positive(curve.median),
      line: { color: law.colour, width: 2.2, shape: "vh" },
      customdata: whole(curve.times.map((_, k) => [curve.least[k], curve.low[k], curve.high[k], curve.most[k]])),
      hovertemplate: `%{y:.3~g} <i>(5 to 95 %: %{customdata[1]:.3~g} to %{customdata[2]:.3~g}; all: %{customdata[0]:.3~g} to %{customdata[3]:.3~g})</i><extra>${plain(law.name)}</extra>`,
    };
  });
  Object.assign(layout, {
    height: heightOf(plot, 320), margin: { l: 78, r: 18, t: 14, b: 44 }, hovermode: "x unified", showlegend: false,
    xaxis: { ...axis, title: title(plot.xlabel, 8), hoverformat: ".5~g", range: [0, Math.max(...plot.curves.flatMap((curve) => curve.times))] },
    yaxis: {
      ...axis, title: title(plot.ylabel, 6),
      ...(plot.log ? { type: "log", exponentformat: "power", range: plot.span, dtick: plot.ticks, tickfont: { size: 11 } } : { rangemode: "tozero" }),
    },
  });
  Plotly.react(plot.name, [...behind, ...thin, ...medians], layout, settings(plot.name));
}

function drawCampaign() {
  report.histograms.forEach(drawHistogram);
  report.envelopes.forEach(drawEnvelope);
}

const switches = document.querySelectorAll(".law-switch");
switches.forEach((button) => button.addEventListener("click", () => {
  const law = Number(button.dataset.law);
  const pressed = hiddenLaws.delete(law);
  if (!pressed) hiddenLaws.add(law);
  switches.forEach((other) => {
    if (other.dataset.law === button.dataset.law) other.setAttribute("aria-pressed", String(pressed));
  });
  drawCampaign();
}));

const rareButton = document.getElementById("rare");
if (rareButton) {
  rareButton.addEventListener("click", () => {
    rare = !rare;
    rareButton.setAttribute("aria-pressed", String(rare));
    report.histograms.forEach(drawHistogram);
  });
}

drawCampaign();
document.addEventListener("toggle", drawCampaign, true);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawCampaign);
