// The panel of sliders: a slider and a field per number, in groups for the start, the spacecraft and each law.
"use strict";

const panel = document.getElementById("dials");
const sliders = [];
const { range: RANGE, near: NEAR } = living.ranges;
const AXES = ["x", "y", "z"];
// The inertia that the sliders move: the true one or that assumed by the laws.
let lawsKnow = true;
const keyOf = (dial) => (dial.key === KNOWN && !lawsKnow ? TRUE : dial.key);

const tidy = (value) => Number(value.toPrecision(4));
const logarithmic = (base, range) => ({
  to: (t) => tidy(base * range ** (2 * t - 1)), from: (value) => 0.5 + 0.5 * Math.log(value / base) / Math.log(range),
});
const linear = (low, high) => ({ to: (t) => tidy(low + (high - low) * t), from: (value) => (value - low) / (high - low) });
// A scale that is fine near zero, for values without a natural size.
const fromZero = (high) => ({ to: (t) => tidy(high * t ** 3), from: (value) => Math.cbrt(value / high) });

function scaleOf(dial, base) {
  if (dial.key === KNOWN) return logarithmic(base, NEAR);
  const bounded = dial.least !== null && dial.most !== null;
  if (bounded) return linear(dial.least, dial.most);
  if (base > 0) return logarithmic(base, RANGE);
  if (dial.law !== null && base === 0) return dial.least === 0 ? fromZero(1) : linear(-1, 1);
  return linear(-2 * Math.abs(base), 2 * Math.abs(base));
}

// The sliders of a key: how each reads the key's value, and how it changes it.
function slidersOf(dial) {
  const value = dial.value;
  const one = (label, base, read, write, scale = scaleOf(dial, base), unit = dial.unit) => ({ dial, label, base, read, write, scale, unit });
  if (dial.key === ATTITUDE) {
    return ["yaw", "pitch", "roll"].map((name, k) => {
      const most = k === 1 ? 90 : 180;
      const write = (given, x) => {
        const angles = anglesOf(given);
        angles[k] = x;
        turned = { angles, value: fromAngles(angles) };
        return turned.value;
      };
      return one(name, anglesOf(value)[k], (given) => anglesOf(given)[k], write, linear(-most, most), "deg");
    });
  }
  if (!Array.isArray(value)) return [one("", value, (given) => given, (given, x) => x)];
  if (!Array.isArray(value[0])) {
    if (dial.law !== null && value.every((x) => x === value[0])) {
      return [one("all axes", value[0], (given) => given[0], (given, x) => given.map(() => x))];
    }
    const most = Math.max(...value.map(Math.abs)) || 0.02;
    // In degrees if the file uses degrees; the file's own number is unchanged.
    const unit = dial.degrees ? 180 / Math.PI : 1;
    const told = (x) => (dial.degrees ? Number((x * unit).toPrecision(12)) : x);
    const meant = (x, k) => (x === told(value[k]) ? value[k] : x / unit);
    const wide = dial.key === "initial.rate" ? linear(-2 * most * unit, 2 * most * unit) : undefined;
    return value.map((base, k) => one(
      AXES[k], told(base), (given) => told(given[k]), (given, x) => given.map((y, i) => (i === k ? meant(x, k) : y)), wide,
      dial.degrees ? dial.unit.replace("rad", "deg") : dial.unit,
    ));
  }
  if (dial.law !== null) {
    // A matrix of gains is scaled as a whole.
    const [i, j] = largest(value);
    const write = (given, x) => (x === 1 ? value : value.map((row) => row.map((y) => y * x)));
    return [one("factor", 1, (given) => given[i][j] / value[i][j], write, logarithmic(1, RANGE), "")];
  }
  const most = Math.max(...flatten(value).map(Math.abs));
  return [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]].map(([i, j]) => one(
    `${AXES[i]}${AXES[j]}`, value[i][j], (given) => given[i][j],
    (given, x) => given.map((row, a) => row.map((y, b) => ((a === i && b === j) || (a === j && b === i) ? x : y))),
    i === j ? logarithmic(value[i][i], NEAR) : linear(-0.5 * most, 0.5 * most),
  ));
}

function largest(matrix) {
  const flat = flatten(matrix).map(Math.abs);
  const place = flat.indexOf(Math.max(...flat));
  return [Math.floor(place / 3), place % 3];
}

// --- angles: yaw, pitch, roll in degrees, about the third, the new second, the new first axis ---

// Angles that were set are kept exactly, because conversion back and forth rounds.
let turned = null;

function anglesOf(given) {
  if (turned && same(turned.value, given)) return turned.angles.slice();
  const size = Math.hypot(...given);
  const [a, b, c, d] = given.map((x) => x / size);
  const degrees = 180 / Math.PI;
  return [
    Math.atan2(2 * (b * c + a * d), a * a + b * b - c * c - d * d) * degrees, Math.asin(Math.max(-1, Math.min(1, 2 * (a * c - b * d)))) * degrees,
    Math.atan2(2 * (c * d + a * b), a * a - b * b - c * c + d * d) * degrees,
  ].map((x) => Number(x.toFixed(6)));
}

function fromAngles(angles) {
  const [yaw, pitch, roll] = angles.map((x) => x * Math.PI / 360);
  const product = (p, q) => [
    p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3], p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
    p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3], p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
  ];
  const { cos, sin } = Math;
  return product(product([cos(yaw), 0, 0, sin(yaw)], [cos(pitch), 0, sin(pitch), 0]), [cos(roll), sin(roll), 0, 0]);
}

// --- the panel ---

function heldBy(key) {
  const numbers = Object.keys(living.laws).filter((number) => living.laws[number].held[key]);
  return numbers.map((number) => [lawOf(number), living.laws[number].held[key]]);
}

function row(slider) {
  const { dial } = slider;
  const box = document.createElement("div");
  box.className = "dial";
  const label = slider.label && dial.key !== ATTITUDE ? `${dial.label} ${slider.label}` : slider.label || dial.label;
  const name = `${told(dial)} ${slider.label}`.trim();
  box.innerHTML = `<label><span>${plain(label)}</span><input class="field" type="text" inputmode="decimal" spellcheck="false" aria-label="${plain(name)}">`
    + `<small>${plain(slider.unit)}</small></label><input class="slide" type="range" min="0" max="1" step="any" aria-label="${plain(name)}, slider"><p class="why" hidden></p>`;
  if (dial.text) box.title = dial.text;
  const [field, slide] = [box.querySelector(".field"), box.querySelector(".slide")];
  Object.assign(slider, { box, field, slide });
  box.dataset.key = dial.key;
  slide.addEventListener("input", () => set(slider, slider.scale.to(Number(slide.value))));
  slide.addEventListener("dblclick", () => set(slider, slider.base));
  field.addEventListener("change", () => set(slider, Number(field.value.trim().replace(",", ".").replace("−", "-") || NaN)));
  return box;
}

function set(slider, value) {
  const { dial } = slider;
  const key = keyOf(dial);
  const bad = !Number.isFinite(value) || !(slider.unit === "deg" || slider.label === "factor" || within(dial, value));
  slider.box.classList.toggle("bad", bad);
  const why = slider.box.querySelector(".why");
  why.hidden = !bad;
  why.textContent = Number.isFinite(value) ? `must be ${boundsOf(dial)}` : "must be a number";
  if (bad) return;
  moved.set(key, slider.write(valueOf(key), value));
  if (!isMoved(key)) moved.delete(key);
  place(slider);
  move();
}

const boundsOf = ({ above, least, most }) => [[above, "above"], [least, "at least"], [most, "at most"]]
  .filter(([bound]) => bound !== null).map(([bound, word]) => `${word} ${bound}`).join(", ");

function place(slider) {
  const value = slider.read(valueOf(keyOf(slider.dial)));
  slider.box.classList.remove("bad");
  slider.box.querySelector(".why").hidden = true;
  slider.field.value = String(value);
  const t = slider.scale.from(value);
  if (document.activeElement !== slider.slide || Math.abs(Number(slider.slide.value) - t) > 2e-3) slider.slide.value = Number.isFinite(t) ? Math.max(0, Math.min(1, t)) : 0;
  slider.box.classList.toggle("off", isMoved(keyOf(slider.dial)) && value !== slider.base);
}

function words() {
  const flying = fates.filter((found) => found.flies).length;
  const staying = fates.map((found, number) => [number, found.stays]).filter(([, why]) => why);
  document.getElementById("staying").innerHTML = staying.map(([number, why]) => `<p><b>${plain(lawOf(number))}</b> stays as the file has it. ${plain(why)}.</p>`).join("");
  document.getElementById("followed").textContent = flying ? "Plots, ranking, views and claims refer to the slider values." : "Plots, ranking, views and claims refer to the file's values.";
}

function group(title, list) {
  if (!list.length) return;
  const box = document.createElement("fieldset");
  box.innerHTML = `<legend>${title}</legend>`;
  for (const dial of list) {
    const held = heldBy(dial.key);
    const laws = Object.keys(living.laws).filter((number) => living.laws[number].follows.includes(dial.key));
    const own = slidersOf(dial);
    for (const slider of own) {
      sliders.push(slider);
      box.append(row(slider));
      if (!laws.length) slider.field.disabled = slider.slide.disabled = true;
    }
    const told = held.length && laws.length ? `${held.map(([name]) => name).join(", ")} cannot follow: ${held[0][1]}.` : held.length ? `Cannot be changed here: ${held[0][1]}.` : "";
    const note = document.createElement("p");
    note.className = "why";
    note.textContent = told;
    if (told) box.append(note);
    if (dial.key === KNOWN && dials.has(TRUE)) box.append(knowing());
  }
  panel.querySelector("#groups").append(box);
}

// Whether the laws know the inertia that the sliders set.
function knowing() {
  const box = document.createElement("label");
  box.className = "knowing";
  box.innerHTML = '<input type="checkbox" id="known" checked> the laws know it';
  box.title = "Off: the laws keep the file's inertia, as after an undetected fault at the start; the angular momentum is unchanged";
  box.querySelector("input").addEventListener("change", ({ target }) => {
    const value = valueOf(keyOf({ key: KNOWN }));
    lawsKnow = target.checked;
    moved.delete(KNOWN);
    moved.delete(TRUE);
    if (!same(value, dials.get(KNOWN).value)) moved.set(lawsKnow ? KNOWN : TRUE, value);
    sliders.forEach(place);
    move();
  });
  return box;
}

const open = (on) => {
  document.body.classList.toggle("dials-open", on);
  document.getElementById("dials-button").setAttribute("aria-expanded", String(on));
};
document.getElementById("dials-button").addEventListener("click", () => open(!document.body.classList.contains("dials-open")));
document.getElementById("dials-close").addEventListener("click", () => open(false));
document.getElementById("dials-reset").addEventListener("click", () => {
  moved.clear();
  turned = null;
  lawsKnow = true;
  if (document.getElementById("known")) document.getElementById("known").checked = true;
  sliders.forEach(place);
  move();
});
document.getElementById("dials-copy").addEventListener("click", ({ target }) => copied(target, fileText()));
document.getElementById("dials-link").addEventListener("click", ({ target }) => copied(target, `${location.href.split("#")[0]}#${hash()}`));

const shared = living.dials.filter((dial) => dial.law === null && dial.key !== TRUE);
group("Start", shared.filter((dial) => dial.key.startsWith("initial.")));
group("Spacecraft", shared.filter((dial) => !dial.key.startsWith("initial.")));
report.laws.forEach((law) => group(`<span class="swatch" style="background:${law.colour}"></span>${plain(law.name)}`, living.dials.filter((dial) => dial.law === law.name)));

function begin() {
  readAddress();
  lawsKnow = !(moved.has(TRUE) && isMoved(TRUE));
  if (document.getElementById("known")) document.getElementById("known").checked = lawsKnow;
  sliders.forEach(place);
  move();
}
addEventListener("hashchange", () => { if (location.hash.slice(1) !== hash()) begin(); });
// A plot that comes into sight or is drawn again causes a flight.
for (const name of ["plots-seen", "plots-drawn"]) {
  document.addEventListener(name, () => fates.forEach((found, number) => { if (found.flies) send(number); }));
}
// Tables of many laws need the room.
open(innerWidth >= 1200 && report.laws.length < 5);
begin();
