// Flies one law again, then measures and thins the flight. This is the whole program of a worker except the law's functions
// `fly`, `derive` and `note`, and `law`, the page's data about it. The numbers are those that Python gives, bit for bit.
"use strict";

const { sqrt, abs, max, min, atan2, asin, floor, ceil } = Math;

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float64Array(bytes.buffer);
}

const base = floats(law.numbers);
const tables = floats(law.tables);
const none = new Float64Array(0);
const width = law.columns.reduce((sum, [, size]) => sum + size, 0);
const column = {};
law.columns.reduce((place, [name, size]) => { column[name] = [place, size]; return place + size; }, 0);
const { every, steps } = law;
const count = floor(steps / every) + 1;
const record = new Float64Array(count * width);
const tick = law.period * every;

// Computes all numbers of the loop from the values of the law's keys, in order.
function numbersOf(values) {
  const all = base.slice();
  if (derive) {
    const found = new Float64Array(law.places.length);
    derive(Float64Array.from(values), found, 1);
    law.places.forEach((place, k) => { all[place] = found[k]; });
  }
  return all;
}

// Writes the samples to `record`; returns their number and the control step at which the motion diverged (-1: it did not).
function flown(values) {
  const all = numbersOf(values);
  const carry = all.slice(0, law.carried);
  const shared = all.slice(law.carried);
  const memories = { carry, record, shared, own: none, tables };
  const given = law.memories.map((name) => memories[name]);
  const call = (first, groups, each, row) => fly(...given, first, groups, each, 0, row, law.seed, law.run);
  const groups = floor(steps / every);
  if (groups) call(0, groups, every, 0);
  const lost = () => carry[law.lost];
  const rest = steps - groups * every;
  if (lost() < 0 && rest) call(groups * every, 1, rest, groups);
  if (lost() >= 0) return { n: max(1, ceil(lost() / every)), lost: lost() };
  // The last sample shows the next command, so one more step is flown and discarded.
  if (!rest) call(steps, 1, 1, groups);
  return { n: count, lost: -1 };
}

// --- quantities of a sample, as `starhold.report` and `starhold.analysis` make them ---

const at = (name, part = 0) => column[name][0] + part;
// Products are used because a power may round differently.
const square3 = (p) => record[p] * record[p] + record[p + 1] * record[p + 1] + record[p + 2] * record[p + 2];
const norm3 = (k, place) => sqrt(square3(k * width + place));

function angleOf(k) {
  const p = k * width + at("attitude_error");
  return 2 * atan2(sqrt(square3(p + 1)), abs(record[p]));
}

function turnOf(k, which) {
  const p = k * width + at("attitude_error");
  const [a, b, c, d] = [record[p], record[p + 1], record[p + 2], record[p + 3]];
  const degrees = 180 / Math.PI;
  if (which === 0) return atan2(2 * (c * d + a * b), 1 - 2 * (b * b + c * c)) * degrees;
  if (which === 1) return asin(max(-1, min(1, 2 * (a * c - b * d)))) * degrees;
  return atan2(2 * (b * c + a * d), 1 - 2 * (c * c + d * d)) * degrees;
}

// The mean derivative of the body's rate between samples; the last one is repeated.
function accelerationOf(k, n, part) {
  if (n < 2) return 0;
  const j = min(k, n - 2);
  return (record[(j + 1) * width + at("rate", part)] - record[j * width + at("rate", part)]) / tick;
}

function curve([kind, ...told], n) {
  const values = new Float64Array(n);
  if (kind === "column") {
    const place = at(told[0], told[1]);
    for (let k = 0; k < n; k++) values[k] = record[k * width + place] * told[2];
  } else if (kind === "norm") {
    const place = at(told[0]);
    for (let k = 0; k < n; k++) values[k] = norm3(k, place) * told[1];
  } else if (kind === "angle") {
    for (let k = 0; k < n; k++) values[k] = angleOf(k) * told[0];
  } else if (kind === "turn") {
    for (let k = 0; k < n; k++) values[k] = turnOf(k, told[0]);
  } else {
    for (let k = 0; k < n; k++) values[k] = accelerationOf(k, n, told[0]) * told[1];
  }
  return values;
}

// Keeps two of every `factor` samples, as `report.plots.thin` does: the extremes where the values between swing far beyond the
// kept ones, otherwise the first and the middle.
function thin(values, factor) {
  const n = values.length;
  if (factor === 1 || !n) return values;
  const groups = ceil(n / factor);
  const found = new Float64Array(2 * groups);
  const value = (k) => values[min(k, n - 1)];
  for (let g = 0; g < groups; g++) {
    const first = g * factor;
    let low = first, high = first;
    for (let k = first + 1; k < first + factor; k++) {
      if (value(k) < value(low)) low = k;
      if (value(k) > value(high)) high = k;
    }
    const middle = first + floor(factor / 2);
    const three = [value(first), value(middle), value(g + 1 < groups ? first + factor : n - 1)];
    const wild = value(high) - value(low) > 3 * (max(...three) - min(...three));
    found[2 * g] = value(wild ? min(low, high) : first);
    found[2 * g + 1] = value(wild ? max(low, high) : middle);
  }
  found[0] = values[0];
  found[2 * groups - 1] = values[n - 1];
  return found;
}

// Inserts gaps where angles jump from one end of their range to the other.
function unwrapped(values) {
  return values.map((value, k) => (k && abs(value - values[k - 1]) > 180 ? NaN : value));
}

// --- metrics: notes by the equation of `starhold.analysis.rigid_body`, and the metrics that its table computes from them ---

const LAST = 0.25, KEPT = 0.1;

// These are the `KINDS` of `starhold.analysis.meter`.
const kinds = {
  number: (x) => x,
  root: sqrt,
  angle: (x) => 2 * asin(sqrt(min(x, 1))),
  overshoot: (a, b, c, x) => (a * a + b * b + c * c < 1e-18 ? 0 : max(x, 0)),
  instant: (...last) => max(...last) + 1,
  crossing: (a, b, ...last) => (a > 1 || b > 1 ? Infinity : max(...last)),
  most: max,
};

// Notes of the first samples, and of those in the last quarter with new windows.
function notes(n, tail, limit) {
  const { first, numbers, memories, windows } = law.meter;
  const told = { tail, last: n - 1, limit: limit === null ? Infinity : limit };
  const shared = Float64Array.from(numbers, (x) => (typeof x === "string" ? told[x] : x));
  const noted = Float64Array.from(first);
  return [[0, tail], [tail, n]].map(([begin, end]) => {
    windows.forEach((row) => { noted[row] = 0; });
    const given = { record: record.subarray(begin * width), noted, shared, own: none, tables: none };
    note(...memories.map((name) => given[name]), begin, end - begin);
    return noted.slice();
  });
}

function metrics(n, lost, asked) {
  const tail = floor(n * (1 - LAST)), counts = { samples: n, tail: max(n - 1 - tail, 1) };
  const [before, after] = notes(n, tail, asked.limit);
  const found = { diverged_at: lost < 0 ? null : lost * law.period, cut_off: [] };
  for (const [name, { kind, rows, times, over, since, final }] of Object.entries(law.meter.table)) {
    let value = kinds[kind](...rows.map((row) => (since === "start" ? max(before[row], after[row]) : after[row])));
    const instant = kind === "instant" || kind === "crossing";
    const late = instant && value > (1 - KEPT) * (n - 1);
    if ((lost >= 0 && (final || instant)) || late) {
      if (lost < 0 && value < n) found.cut_off.push(name);
      found[name] = null;
      continue;
    }
    for (const factor of times) value *= factor;
    if (over) value /= counts[over[0]] * over[1];
    found[name] = Number.isNaN(value) ? null : value;
  }
  return found;
}

// Answers a move of the page: values, thinned plots by name with the data of their panels, frames and metrics.
function answer(asked) {
  const { n, lost } = flown(asked.values);
  const shown = asked.early ? min(n, asked.early) : n;
  const curves = {};
  for (const [name, sources] of Object.entries(asked.plots)) {
    curves[name] = sources.map((source) => {
      const values = thin(curve(source, shown), asked.factor);
      return source[0] === "turn" ? unwrapped(values) : values;
    });
  }
  const frames = asked.frames.filter((k) => k < n).map((k) => [0, 1, 2, 3].map((i) => record[k * width + at("attitude_error", i)]));
  return {
    number: asked.number, n, lost, curves, frames, metrics: metrics(n, lost, asked), last: record.slice((n - 1) * width, n * width),
  };
}

if (typeof postMessage === "function") onmessage = ({ data }) => postMessage(answer(data));
