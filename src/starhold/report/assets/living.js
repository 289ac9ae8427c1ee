// Sliders: workers fly the laws again with the new values; plots, ranking, views and claims are updated.
"use strict";

const living = report.living;
const dials = new Map(living.dials.map((dial) => [dial.key, dial]));
const moved = new Map();
const KNOWN = "spacecraft.inertia", TRUE = "fault[1].inertia";
const ATTITUDE = "initial.attitude";
const flatten = (value) => (Array.isArray(value) ? value.flatMap(flatten) : [value]);
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

// The value of a key: its own if it was moved, else that of the key that it follows, else the file's.
function valueOf(key) {
  if (moved.has(key)) return moved.get(key);
  const leader = living.linked[key];
  return leader && moved.has(leader) ? moved.get(leader) : dials.get(key).value;
}

const isMoved = (key) => !same(valueOf(key), dials.get(key).value);
const lawOf = (number) => report.laws[number].name;

// --- the laws' workers ---

const sources = new Map(Object.entries(living.laws).map(([number, law]) => {
  const { fly, derive, note, ...told } = law;
  const program = ({ text, name }) => `(() => {\n${text}\nreturn ${name};\n})()`;
  return [Number(number), `"use strict";\nconst law = ${JSON.stringify({ ...told, every: living.every })};\n`
    + `const fly = ${program(fly)};\nconst derive = ${derive ? program(derive) : "null"};\nconst note = ${program(note)};\n${document.getElementById("flight").textContent}`];
}));
const runners = new Map();
const state = { asked: 0, flown: 0, arrived: [], results: new Map(), wanted: false };

function runnerOf(number) {
  if (!runners.has(number)) {
    const place = URL.createObjectURL(new Blob([sources.get(number)], { type: "text/javascript" }));
    const runner = { worker: new Worker(place), busy: false, again: false };
    runner.worker.onmessage = ({ data }) => {
      runner.busy = false;
      state.arrived.push([number, data]);
      requestAnimationFrame(show);
      if (runner.again) send(number);
    };
    runners.set(number, runner);
  }
  return runners.get(number);
}

// Whether a law flies again after a move: not if none of its keys is moved, or if it cannot follow one of them.
function fate(number) {
  const law = living.laws[number];
  if (!law) return living.grounded[number] ? { stays: living.grounded[number] } : {};
  const changed = living.dials.map((dial) => dial.key).filter(isMoved);
  const stuck = changed.find((key) => law.held[key] && !(living.linked[key] && !moved.has(key)));
  if (stuck) return { stays: `${told(dials.get(stuck))}: ${law.held[stuck]}` };
  return { flies: changed.some((key) => law.follows.includes(key)) };
}

const told = (dial) => (dial.law === null ? dial.label : `${dial.law} ${dial.label}`);

function request(number) {
  const law = living.laws[number];
  const early = transient && report.transient;
  const sight = [...charts.values()].filter((chart) => chart.seen && chart.plot.panels.every((panel) => panel.source && panel.source.length));
  const rows = living.ranking.rows[number];
  return {
    number: ++state.asked, values: flatten(law.follows.map(valueOf)),
    plots: Object.fromEntries(sight.map((chart) => [chart.plot.name, chart.plot.panels.map((panel) => panel.source)])),
    early: early ? living.early.samples : null, factor: early ? living.early.factor : living.factor,
    frames: report.scene.places,
    limit: moved.has("spacecraft.torque_limit") ? moved.get("spacecraft.torque_limit") : rows.limit.size,
  };
}

function send(number) {
  const runner = runnerOf(number);
  runner.again = runner.busy;
  if (runner.busy) return;
  runner.busy = true;
  const asked = request(number);
  runner.early = transient;
  runner.worker.postMessage(asked);
}

// --- updates after a move ---

let fates = [];

function move() {
  const wrong = refusal();
  fates = report.laws.map((_, number) => fate(number));
  document.getElementById("unsound").textContent = `The program refuses this, so nothing flies again: ${wrong}.`;
  document.getElementById("unsound").hidden = !wrong;
  document.getElementById("dials-copy").disabled = Boolean(wrong);
  if (!wrong) {
    fates.forEach((found, number) => {
      if (found.flies) send(number); else if (state.results.has(number)) restore(number);
    });
  }
  claims();
  words();
  address();
}

// Restores a law to the flight of the file's numbers.
function restore(number) {
  state.results.delete(number);
  for (const chart of charts.values()) {
    if (chart.plot.panels.every((panel) => panel.source && panel.source.length)) {
      setCurves(chart.plot.name, number, chart.plot.panels.map((panel) => panel.curves[number]), rowOf(number).metrics.diverged_at !== null);
    }
  }
  if (typeof views !== "undefined") views[number].frames = report.scene.attitudes[number];
  redrawChanged();
  rank();
}

const rowOf = (number) => living.ranking.rows[number];

function show() {
  const arrived = state.arrived.splice(0);
  if (!arrived.length) return;
  for (const [number, found] of arrived) {
    if (!fates[number] || !fates[number].flies) continue;
    state.results.set(number, found);
    state.flown += 1;
    if (runners.get(number).early === transient) {
      for (const [name, curves] of Object.entries(found.curves)) setCurves(name, number, curves, found.lost >= 0);
    }
    const steps = charts.get("accuracy");
    if (steps) {
      setCurves("accuracy", number, ["", "rate_"].map((kind) => steps.plot.x.map((k) => found.metrics[`${kind}iterations_1e-${k}`])), false);
    }
    if (found.frames.length) views[number].frames = found.frames;
  }
  redrawChanged();
  reshape();
  rank();
  document.dispatchEvent(new CustomEvent("flown", { detail: arrived }));
}

// The outline of the body follows its inertia.
function reshape() {
  const inertia = valueOf(TRUE);
  Object.assign(scene, boxOf(inertia));
  model = craft();
  repaint();
}

// Half edges of the uniform box with this inertia, the longest 0.95, and its axes as columns, computed as in the report.
function boxOf(inertia) {
  const [moments, axes] = Array.isArray(inertia[0]) ? principal(inertia) : [inertia, [[1, 0, 0], [0, 1, 0], [0, 0, 1]]];
  const sum = moments[0] + moments[1] + moments[2];
  const edges = moments.map((moment) => Math.sqrt(Math.max(sum - 2 * moment, 0)));
  const most = Math.max(...edges);
  return { size: edges.map((edge) => 0.95 * Math.max(edge / most, 0.1)), axes };
}

// Jacobi's eigenvalue method: returns the moments, and the axes as columns.
function principal(matrix) {
  const a = matrix.map((row) => row.slice());
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let turn = 0; turn < 30; turn++) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (a[p][q] === 0) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
      const c = 1 / Math.sqrt(t * t + 1), s = t * c;
      for (let k = 0; k < 3; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  return [[a[0][0], a[1][1], a[2][2]], v];
}

// --- ranking, as `analysis.ranking` does it ---

const metricsOf = (number) => {
  const found = state.results.get(number);
  return found ? { ...rowOf(number).metrics, ...found.metrics } : rowOf(number).metrics;
};

// A number as Python's %g writes it.
function general(value, digits) {
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  const bare = (text) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (value === 0) return "0";
  if (power < -4 || power >= digits) return `${bare(mantissa)}e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
  return bare(value.toFixed(Math.max(0, digits - 1 - power)));
}

function shown({ name, scale }, row) {
  const value = row[name];
  const late = (row.cut_off || []).includes(name) ? " †" : "";
  if (value === null || value === undefined) return `—${late}`;
  if (name.startsWith("iterations")) return `${Math.trunc(value)}${late}`;
  const scaled = value * scale;
  return (Math.abs(scaled) < 1e3 ? general(scaled, 3) : scaled.toFixed(0)) + late;
}

function rank() {
  const { measures, order, rows } = living.ranking;
  const found = rows.map((_, number) => metricsOf(number));
  const lost = (number) => found[number].diverged_at !== null && found[number].diverged_at !== undefined;
  const stays = (number) => Boolean(fates[number] && fates[number].stays);
  const key = (number) => [Number(stays(number)), Number(lost(number)), ...order.map((name) => found[number][name] ?? Infinity)];
  const before = (a, b) => {
    const [x, y] = [key(a), key(b)];
    const at = x.findIndex((value, k) => value !== y[k]);
    return at < 0 ? a - b : x[at] - y[at];
  };
  const best = measures.map(({ name }) => {
    const given = rows.map((_, number) => number).filter((number) => !lost(number) && !stays(number) && found[number][name] !== null && found[number][name] !== undefined);
    const least = Math.min(...given.map((number) => found[number][name]));
    const winners = given.filter((number) => found[number][name] === least);
    return given.length > 1 && winners.length < given.length ? winners : [];
  });
  const names = (list) => list.map((number) => `<span class="swatch" style="background:${rows[number].colour}"></span>${plain(rows[number].name)}`).join(", ");
  const won = measures.flatMap(({ name, heading }, k) => (order.includes(name) && best[k].length ? [`<span>${plain(heading)}: ${names(best[k])}</span>`] : []));
  const told = document.querySelector(".best-at");
  if (told) {
    told.innerHTML = `<strong>Best</strong> ${won.join("")}`;
    told.hidden = !won.length;
  }
  const body = document.querySelector("table.ranking tbody");
  body.innerHTML = rows.map((_, number) => number).sort(before).map((number) => {
    const row = rows[number];
    const why = stays(number) ? "as the file has it" : lost(number) ? `at ${general(found[number].diverged_at, 6)} s` : row.law !== row.name ? row.law : "";
    const cells = measures.map((measure, k) => `<td class="number${best[k].includes(number) ? " best" : ""}">${shown(measure, found[number])}</td>`).join("");
    const [word, mood] = lost(number) ? ["diverged", "refuted"] : found[number].settling_time === null ? ["not settled", "undecided"] : ["settled", "proved"];
    return `<tr class="${lost(number) ? "lost" : ""}${stays(number) ? " stays" : ""}"><th scope="row">`
      + `<span class="swatch" style="background:${row.colour}"></span>${plain(row.name)}${why ? `<small>${plain(why)}</small>` : ""}</th><td class="words"><span class="outcome ${mood}">${word}</span></td>${cells}</tr>`;
  }).join("");
}

// --- claims: highlighted while the values that they depend on are unchanged ---

function standing(claim) {
  const gains = living.dials.find((dial) => dial.law === claim.law && isMoved(dial.key));
  if (gains) return { fails: `${gains.label} has changed` };
  if (dials.has(KNOWN)) {
    if (!claim.known && isMoved(KNOWN)) return { fails: "the law's nominal inertia has changed" };
    if (isMoved(TRUE)) {
      if (claim.true === "given") return { fails: "the inertia has changed" };
      if (claim.true === "any") return { holds: "proved for every inertia that the law does not know" };
      const inside = inBox(claim);
      if (!inside) return { fails: `the inertia is outside the box of ${general(100 * claim.tolerance, 3)} %` };
      return { holds: `the inertia is within the box of ${general(100 * claim.tolerance, 3)} %` };
    }
  }
  const limit = "spacecraft.torque_limit";
  if (dials.has(limit) && isMoved(limit) && claim.limit !== "any") {
    if (claim.limit === "given" || valueOf(limit) < dials.get(limit).value) return { fails: "the torque limit has changed" };
    return { holds: "the torque limit has not decreased" };
  }
  const begun = ["initial.attitude", "initial.rate"].some((key) => dials.has(key) && isMoved(key));
  if (begun && !claim.momentum) return { fails: "the initial angular momentum has changed" };
  if (begun && claim.start !== null) return { holds: "whether its set contains this start is not checked here" };
  return {};
}

function inBox(claim) {
  const matrix = (value) => (Array.isArray(value[0]) ? value : value.map((x, i) => [0, 1, 2].map((j) => (i === j ? x : 0))));
  const [now, file] = [matrix(valueOf(TRUE)), matrix(dials.get(TRUE).value)];
  return now.every((row, i) => row.every((x, j) => Math.abs(x - file[i][j]) <= claim.tolerance * Math.sqrt(claim.moments[i] * claim.moments[j])));
}

function claims() {
  for (const claim of living.claims) {
    const box = document.querySelector(`[data-claim="${claim.mark}"]`);
    const { fails, holds } = standing(claim);
    box.classList.toggle("grey", Boolean(fails));
    box.classList.toggle("moved", Boolean(fails || holds));
    let why = box.querySelector(".now");
    if (!why) {
      why = document.createElement("span");
      why.className = "why now";
      box.querySelector(".what").append(why);
    }
    const outcome = box.querySelector(".outcome").textContent;
    why.textContent = fails ? `This applies to the file's numbers, not to these: ${fails}.` : holds ? `Still ${outcome}: ${holds}.` : "";
  }
  document.body.classList.toggle("moved", living.dials.some((dial) => isMoved(dial.key)));
}

// --- refusals of the program ---

// The texts of functions run as a script of the page, because its policy forbids `eval`.
const questions = [];
const script = document.createElement("script");
script.textContent = living.asked.map(({ program }) => `questions.push((() => {\n${program.text}\nreturn ${program.name};\n})());`).join("\n");
document.head.append(script);

// A number as Python's format "g" or ".4g" writes it.
const formatted = (value, spec) => (Number.isFinite(value) ? general(value, Number(spec.match(/\.(\d+)g/)?.[1] ?? 6)) : String(value));

// The program's message about the current file; "" if it accepts the file.
function refusal() {
  const { least, most } = living.ranges;
  for (const dial of living.dials.filter(({ key }) => isMoved(key))) {
    const sizes = flatten(valueOf(dial.key)).map(Math.abs), size = Math.max(...sizes);
    if (size && !(size >= least && size <= most)) return `${told(dial)}: 0, or between ${least} and ${most} in size`;
    if (dial.unit === "rad" && size > 2 * Math.PI) return `${told(dial)}: a plain number is in rad, within 2 pi`;
    const range = living.ranged[dial.key];
    const beyond = (x, k) => x > flatten(dial.value).map(Math.abs)[k] * range * 1.001 || x < flatten(dial.value).map(Math.abs)[k] / range / 1.001;
    const diagonal = (k) => sizes.length !== 9 || k % 4 === 0;
    if (range && sizes.some((x, k) => diagonal(k) && beyond(x, k))) return `${told(dial)}: only up to ${range} times the file's, or down to 1/${range}: beyond this a law may refuse it by a check that the page does not have`;
  }
  for (const [place, { keys, refusals }] of living.asked.entries()) {
    const found = new Float64Array(1 + Math.max(...refusals.flatMap(([flag, words]) => [flag, ...words.map((word) => word[0]).filter(Number.isInteger)])));
    questions[place](Float64Array.from(flatten(keys.map(valueOf))), found, 1);
    const held = refusals.find(([flag]) => found[flag] === 1);
    if (held) return held[1].map((word) => (typeof word === "string" ? word : formatted(found[word[0]], word[1]))).join("");
  }
  return "";
}

// --- the file of the current values, and its address ---

// A number in a form that Python reads back with the same bits.
function written(value) {
  if (Array.isArray(value)) return `[${value.map(written).join(", ")}]`;
  const text = Object.is(value, -0) ? "-0.0" : String(value);
  return Number.isInteger(value) && !text.includes("e") && !text.includes(".") ? `${text}.0` : text;
}

function fileText() {
  return living.file.filter((piece) => !piece.only || (moved.has(piece.only) && isMoved(piece.only)))
    .map((piece) => (piece.key ? written(valueOf(piece.key)) : piece.text)).join("");
}

function hash() {
  return [...moved].filter(([key]) => isMoved(key)).map(([key, value]) => `${encodeURIComponent(key)}=${encodeURIComponent(JSON.stringify(value))}`).join("&");
}

let addressed = 0;
function address() {
  // Browsers refuse more than a few changes per second.
  clearTimeout(addressed);
  addressed = setTimeout(() => history.replaceState(null, "", `#${hash()}`), 250);
}

function readAddress() {
  moved.clear();
  for (const part of location.hash.slice(1).split("&").filter(Boolean)) {
    try {
      const [key, value] = part.split("=").map(decodeURIComponent);
      const given = JSON.parse(value);
      const like = dials.get(key);
      const sound = like && Object.values(living.laws).some((law) => law.follows.includes(key)) && flatten(given).every((x) => typeof x === "number" && Number.isFinite(x))
        && same(shapeOf(given), shapeOf(like.value)) && flatten(given).every((x) => within(like, x));
      if (sound) moved.set(key, given);
    } catch {
      // A malformed address moves nothing.
    }
  }
}

const shapeOf = (value) => (Array.isArray(value) ? value.map(shapeOf) : 0);
const within = ({ above, least, most }, x) => !(above !== null && x <= above) && !(least !== null && x < least) && !(most !== null && x > most);

async function copied(button, text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const field = document.createElement("textarea");
    field.value = text;
    document.body.append(field);
    field.select();
    document.execCommand("copy");
    field.remove();
  }
  const before = button.textContent;
  button.textContent = "Copied";
  setTimeout(() => { button.textContent = before; }, 1200);
}
