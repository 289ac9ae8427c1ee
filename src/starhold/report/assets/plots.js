// Draws the plots of a comparison with Plotly, in the colours of the page.
"use strict";

const report = JSON.parse(document.getElementById("data").textContent);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// Plotly reads names as HTML; what comes from files is shown as it stands.
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

function look() {
  const axis = { gridcolor: css("--line"), linecolor: css("--soft"), zerolinecolor: css("--line"), automargin: false };
  return {
    axis,
    layout: {
      font: { family: "system-ui, sans-serif", size: 12.5, color: css("--ink") },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: css("--line"), activecolor: css("--soft") },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      hoverlabel: { bgcolor: css("--card"), bordercolor: css("--line"), font: { color: css("--ink") } },
      legend: { orientation: "h", x: 0, y: 1, yanchor: "bottom", xanchor: "left", traceorder: "normal" },
    },
  };
}

// Of a run that is long beside its transient both can be seen; the page has a switch.
let transient = false;
const shownNow = (plot) => (transient && report.transient && report.transient.plots[plot.name]) || plot;
const timesOf = (plot) => plot.x || (transient && report.transient ? report.transient.times : report.times);

function lines(panel, k, plot) {
  return panel.order.map((number) => {
    const law = report.laws[number];
    return {
      type: "scatter", mode: plot.markers ? "lines+markers" : "lines",
      x: timesOf(plot), y: panel.curves[number], yaxis: k ? `y${k + 1}` : "y", xaxis: plot.split && k ? `x${k + 1}` : "x",
      name: plain(law.name), legendgroup: `law${number}`, legendrank: number + 1, showlegend: k === 0,
      line: { color: law.colour, width: panel.widths[number] }, marker: { size: 8 },
      hovertemplate: `%{y:${panel.log ? ".3~e" : ".4~g"}}<extra>${plain(law.name)}${plot.panels.length > 1 ? ", " + plain(panel.label) : ""}</extra>`,
    };
  });
}

function draw(plot) {
  const { axis, layout } = look();
  const count = plot.panels.length;
  const rows = plot.split ? 1 : count;
  Object.assign(layout, {
    height: 74 + (rows === 1 ? 270 : rows === 2 ? 400 : 150 * rows), margin: { l: 78, r: 18, t: 34, b: 44 },
    hovermode: "x unified", hoversubplots: "axis", shapes: [],
  });
  plot.panels.forEach((panel, k) => {
    const id = k ? k + 1 : "";
    const x = { ...axis, title: { text: plot.xlabel, standoff: 8 }, hoverformat: ".5~g" };
    if (plot.split) {
      layout[`xaxis${id}`] = { ...x, dtick: 1, domain: [k / count + (k ? 0.04 : 0), (k + 1) / count - (k < count - 1 ? 0.04 : 0)], anchor: `y${id}` };
    } else {
      layout.xaxis = { ...x, anchor: `y${count > 1 ? count : ""}` };
    }
    const top = 1 - k / rows;
    layout[`yaxis${id}`] = {
      ...axis, title: { text: plain(panel.label), standoff: 6 }, anchor: plot.split ? `x${id}` : "x",
      domain: plot.split ? [0, 1] : [top - 1 / rows + (k < rows - 1 ? 0.025 : 0), top - (k ? 0.025 : 0)],
      ...(panel.log ? { type: "log", exponentformat: "power", ...(panel.ticks ? { dtick: panel.ticks } : {}) } : {}),
      ...(panel.span ? { range: panel.log ? panel.span.map(Math.log10) : panel.span } : {}),
      ...(plot.split ? { rangemode: "tozero" } : {}),
    };
    for (const mark of plot.marks || []) {
      layout.shapes.push({
        type: "line", xref: "x", x0: mark, x1: mark, yref: `y${id} domain`, y0: 0, y1: 1,
        line: { color: css("--soft"), width: 1.2, dash: "dot" },
      });
    }
    for (const level of panel.levels) {
      layout.shapes.push({
        type: "line", xref: "paper", x0: 0, x1: 1, yref: `y${id}`, y0: level, y1: level,
        line: { color: css("--soft"), width: 1.2, dash: "dash" },
      });
    }
  });
  const traces = plot.panels.flatMap((panel, k) => lines(panel, k, plot));
  Plotly.react(plot.name, traces, layout, {
    responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"],
    toImageButtonOptions: { filename: plot.name, scale: 2 },
  });
}

function drawAll() {
  report.plots.filter((plot) => !plot.planes).map(shownNow).forEach(draw);
}

if (report.transient) {
  const buttons = [document.getElementById("whole"), document.getElementById("transient-only")];
  buttons.forEach((button, one) => button.addEventListener("click", () => {
    transient = one === 1;
    buttons.forEach((other) => other.setAttribute("aria-pressed", String(other === button)));
    drawAll();
  }));
}

drawAll();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
