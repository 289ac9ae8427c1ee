// Plane pictures: the paths of all laws in one plot, with reference lines and areas.
"use strict";

function guideLine(guide, k) {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const fills = { light: dark ? "#1d2c3b" : "#e8f1fa", dark: dark ? "#28435e" : "#c3dcf1" };
  const shared = {
    type: "scatter", x: guide.x, y: guide.y, xaxis: k ? `x${k + 1}` : "x", yaxis: k ? `y${k + 1}` : "y",
    showlegend: false, hoverinfo: "skip", mode: "lines",
  };
  if (fills[guide.kind]) return { ...shared, fill: "toself", fillcolor: fills[guide.kind], line: { width: 0 } };
  if (guide.kind === "faint") return { ...shared, line: { color: css("--line"), width: 1 } };
  if (guide.kind === "points") return { ...shared, mode: "markers", marker: { size: 9, color: guide.colour || css("--soft") } };
  return { ...shared, line: { color: guide.colour || css("--soft"), width: 1.4, dash: "dash" } };
}

function drawPlanes(plot) {
  const { axis, layout } = look();
  const count = plot.planes.length;
  const box = document.getElementById(plot.name);
  if (!box.clientWidth) return;
  const wide = Math.min(box.clientWidth, count === 1 ? 760 : 1300);
  const columns = wide < 820 ? Math.min(count, 2) : count;
  const rows = Math.ceil(count / columns);
  const gap = columns < count ? 0.13 : 0.07;
  const share = (1 - gap * (columns - 1)) / columns;
  const side = (wide - 96) * share;
  const tall = rows * side + (rows - 1) * 60;
  Object.assign(layout, { height: tall + 34 + 52, width: wide, margin: { l: 62, r: 34, t: 34, b: 52 }, hovermode: "closest" });
  const traces = [];
  plot.planes.forEach((plane, k) => {
    const id = k ? k + 1 : "";
    const from = (k % columns) * (share + gap);
    const top = 1 - Math.floor(k / columns) * (side + 60) / tall;
    const word = (label) => label.replace(/_(.)/, "<sub>$1</sub>");
    layout[`xaxis${id}`] = {
      ...axis, title: { text: word(plane.xlabel), standoff: 6 }, domain: [from, from + share], anchor: `y${id}`,
      range: plane.span.slice(0, 2), nticks: 6,
    };
    layout[`yaxis${id}`] = {
      ...axis, title: { text: word(plane.ylabel), standoff: 2 }, anchor: `x${id}`, range: plane.span.slice(2),
      domain: [Math.max(0, top - side / tall), top],
      ...(plane.equal ? { scaleanchor: `x${id}`, constrain: "domain" } : {}),
    };
    plane.guides.forEach((guide) => traces.push(guideLine(guide, k)));
    plane.lines.forEach((line, number) => {
      const law = report.laws[number];
      const thin = 1 - 0.5 * number / Math.max(plane.lines.length - 1, 1);
      traces.push({
        type: "scatter", mode: "lines", x: line.x, y: line.y, xaxis: `x${id}`, yaxis: `y${id}`,
        name: plain(law.name), legendgroup: `law${number}`, legendrank: number + 1, showlegend: k === 0,
        line: { color: law.colour, width: 2 * thin }, hovertemplate: `%{x:.4~g}, %{y:.4~g}<extra>${plain(law.name)}</extra>`,
      });
    });
  });
  Plotly.react(plot.name, traces, layout, {
    displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"], toImageButtonOptions: { filename: plot.name, scale: 2 },
  });
}

function drawAllPlanes() {
  report.plots.filter((plot) => plot.planes).forEach(drawPlanes);
}

drawAllPlanes();
addEventListener("resize", drawAllPlanes);
// A plot in a fold has no size until the fold is opened.
document.addEventListener("toggle", drawAllPlanes, true);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAllPlanes);
