// The studio's page: an editor with completion and errors at the key, and results beside each other.
"use strict";

const $ = (id) => document.getElementById(id);
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;").replace(/"/g, "&quot;");
let known = null;
let editor = null;
let wrong = null;

async function ask(path, body) {
  const answer = await fetch(path, body === undefined ? {} : {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
  });
  const found = await answer.json();
  return { ok: answer.ok, ...(Array.isArray(found) ? { list: found } : found) };
}

// --- completion: the keys of the table at the cursor, or the words allowed for the key before it ---

function tableAt(line) {
  let name = "", type = null, first = 0;
  for (let k = line; k >= 0; k--) {
    const head = editor.getLine(k).match(/^\s*\[\[?\s*([^\]]+?)\s*\]\]?/);
    if (head) {
      [name, first] = [head[1], k];
      break;
    }
  }
  for (let k = first + (name ? 1 : 0); k < editor.lineCount(); k++) {
    const text = editor.getLine(k);
    if (/^\s*\[/.test(text)) break;
    const own = text.match(/^\s*type\s*=\s*"([^"]+)"/);
    if (own) type = own[1];
  }
  return { name, type };
}

function keysOf({ name, type }) {
  if (name === "law" || name === "part") {
    return known.words[name][type] || { type: { text: `which ${name}`, words: Object.keys(known.words[name]) } };
  }
  return known.words.tables[name] || {};
}

function completion(cm) {
  const cursor = cm.getCursor();
  const before = cm.getLine(cursor.line).slice(0, cursor.ch);
  const table = tableAt(cursor.line);
  const part = before.match(/[\w."-]*$/)[0];
  const list = (items, from) => ({ list: items, from: { line: cursor.line, ch: from }, to: cursor });
  const item = (text, told) => ({
    text, render: (box) => { box.innerHTML = `${plain(text.trim())}<small>${plain(told || "")}</small>`; },
  });
  const heading = before.match(/^\s*\[\[?\s*([\w.-]*)$/);
  if (heading) {
    const names = [...Object.keys(known.words.tables).filter(Boolean), "law", "part"];
    return list(names.filter((name) => name.startsWith(heading[1])).map((name) => item(name)), cursor.ch - heading[1].length);
  }
  const set = before.match(/^\s*([\w-]+)\s*=\s*"?([\w-]*)$/);
  if (set) {
    const told = keysOf(table)[set[1]];
    const words = set[1] === "type" && known.words[table.name] ? Object.keys(known.words[table.name]) : (told && told.words) || [];
    const from = cursor.ch - set[2].length - (before.endsWith(`"${set[2]}`) ? 1 : 0);
    return list(words.filter((word) => String(word).startsWith(set[2])).map((word) => item(JSON.stringify(word))), from);
  }
  const keys = keysOf(table);
  const free = Object.keys(keys).filter((key) => key.startsWith(part));
  return list(free.map((key) => item(`${key} = `, keys[key].text)), cursor.ch - part.length);
}

// --- questions to the user ---

// Resolves with the value of the button that is pressed, "" for none; with a field, [value, its text].
function choose(text, buttons, field = null) {
  const box = $("asking");
  box.querySelector("p").textContent = text;
  const input = box.querySelector("input");
  input.hidden = field === null;
  input.value = field ?? "";
  box.querySelector(".tools").innerHTML = Object.entries(buttons).map(([value, word]) => `<button value="${value}">${plain(word)}</button>`).join("");
  box.showModal();
  return new Promise((done) => {
    const answer = (value) => done(field === null ? value : [value, input.value.trim()]);
    for (const button of box.querySelectorAll("button")) button.addEventListener("click", () => answer(button.value));
    box.oncancel = () => answer("");
  });
}

// --- the document: its name, the version of its file when last read or saved ("" without a file), and its text then ---

const doc = { name: "", version: "", saved: "" };
const edited = () => Boolean(editor) && editor.getValue() !== doc.saved;

function show(name, version, text) {
  Object.assign(doc, { name, version, saved: text });
  editor.setValue(text);
  editor.clearHistory();
  named();
  check();
}

function named() {
  $("file").textContent = `${doc.name}${doc.version ? "" : " (not saved as a file)"}${edited() ? " — edited" : ""}`;
  document.title = `${edited() ? "• " : ""}${doc.name} — starhold studio`;
}

// Whether another text may replace the edited one; asks the user if there are unsaved edits.
async function room() {
  if (!edited()) return true;
  const how = await choose(`${doc.name} has edits that are not saved.`, { save: "Save them", drop: "Drop them", "": "Stay here" });
  return how === "drop" || (how === "save" && save());
}

// Returns whether the text was saved.
async function save() {
  let { name, version } = doc;
  for (let again = !version; ; again = true) {
    if (again) {
      const [how, given] = await choose(`A name for this scenario, in ${known.folder}:`, { save: "Save", "": "Cancel" }, name);
      if (how !== "save") return false;
      [name, version] = [given, given === doc.name ? version : ""];
    }
    const text = editor.getValue();
    let found = await ask("/save", { text, name, version });
    if (found.changed && !found.exists) {
      const how = await choose(`${found.error}. What is there now would be lost.`, { over: "Overwrite it", other: "Another name", "": "Cancel" });
      if (how === "") return false;
      if (how === "over") found = await ask("/save", { text, name, version: found.version });
      else continue;
    }
    if (!found.error) {
      Object.assign(doc, { name: found.name, version: found.version, saved: text });
      named();
      say(`saved ${found.saved}`);
      return true;
    }
    say(found.error, "bad");
    if (!found.exists) return false;
    await choose(`${found.error}; it is not overwritten.`, { "": "Another name" });
  }
}

// --- errors at the key ---

let checking = 0;
let verdict = null;
let busy = null;
function soon() {
  named();
  clearTimeout(checking);
  checking = setTimeout(check, 300);
}

// Checks the text in the editor; one check runs at a time.
async function check() {
  clearTimeout(checking);
  while (busy) await busy;
  const text = editor.getValue();
  if (verdict && verdict.text === text) return verdict.found;
  say("is checked …", "");
  let ended;
  busy = new Promise((done) => { ended = done; });
  const found = await ask("/check", { text }).catch((error) => ({ error: `the studio does not answer: ${error.message}` }));
  busy = null;
  ended();
  if (text !== editor.getValue()) return check();
  verdict = { text, found };
  tell(found);
  return found;
}

function say(text, how = "good") {
  $("verdict").className = how;
  $("verdict").textContent = text;
}

function tell(found) {
  if (wrong !== null) editor.removeLineClass(wrong, "background", "wrong-line");
  wrong = null;
  if (found.asks) {
    say(`Checking this scenario runs Python code: ${found.asks.join(", ")}. It has all your permissions, and runs again at each check and flight. `, "");
    const button = document.createElement("button");
    button.textContent = "Run it";
    button.addEventListener("click", async () => {
      await ask("/run", { files: found.asks });
      verdict = null;
      check();
    });
    $("verdict").append(button);
    return;
  }
  say(found.error || `${found.name}: ${found.laws.join(", ")}`, found.error ? "bad" : "good");
  if (found.line) wrong = editor.addLineClass(found.line - 1, "background", "wrong-line");
}

// --- jobs ---

const boxes = new Map();

async function begin(kind) {
  // A text with errors is not sent: the editor shows them, while the server would only refuse the job.
  if (!(await check()).name) return;
  started(await ask("/jobs", { kind, text: editor.getValue() }), doc.name);
}

function started(found, name) {
  if (!found.ok) {
    tell(found);
    return;
  }
  place(found, name);
  watch();
}

function place(job, name = "") {
  document.querySelector("#results .hint")?.remove();
  const box = document.createElement("div");
  box.className = "result";
  box.dataset.document = name;
  const tab = document.createElement("button");
  tab.type = "button";
  tab.textContent = `${job.number} ${job.kind}`;
  tab.addEventListener("click", () => front(box));
  box.tab = tab;
  $("tabs").prepend(tab);
  front(box);
  box.innerHTML = `<div><b>${plain(job.kind)}</b><span class="said"></span><progress></progress><button type="button">Stop</button></div>`;
  box.querySelector("button").addEventListener("click", () => {
    if (box.dataset.ended) {
      box.remove();
      tab.remove();
      boxes.delete(job.number);
      const next = [...boxes.values()].pop();
      if (next) front(next);
    } else ask(`/jobs/${job.number}/stop`, {});
  });
  $("results").prepend(box);
  boxes.set(job.number, box);
}

// Brings one result to the front; side by side, all are visible.
function front(box) {
  for (const one of document.querySelectorAll(".result.front, #tabs .front")) one.classList.remove("front");
  box.classList.add("front");
  box.tab.classList.add("front");
}

function update(job) {
  const box = boxes.get(job.number);
  if (!box || box.dataset.ended) return;
  const [said, bar] = [box.querySelector(".said"), box.querySelector("progress")];
  said.textContent = job.error || (job.shown ? job.name : job.total ? `${job.what}: ${job.done} of ${job.total}` : job.what || "begins");
  said.classList.toggle("bad", Boolean(job.error));
  if (job.total) [bar.max, bar.value] = [job.total, job.done];
  else bar.removeAttribute("value");
  if (!job.ended) return;
  box.dataset.ended = "yes";
  bar.remove();
  box.querySelector("button").textContent = "Close";
  box.classList.toggle("failed", !job.shown);
  if (!job.shown) return;
  const address = `/results/${job.number}/${job.shown}`;
  const shown = document.createElement(job.shown.endsWith(".png") ? "img" : "iframe");
  shown.src = address;
  shown.title = shown.alt = `${job.kind} ${job.name}`;
  box.append(shown);
  const apart = document.createElement("button");
  apart.textContent = "Alone";
  apart.addEventListener("click", () => open(address));
  box.querySelector("div").insertBefore(apart, box.querySelector("button"));
  if (job.kind === "campaign") box.querySelector("div").insertBefore(again(job), apart);
  shown.addEventListener("load", () => { if (shown.contentWindow && shown.contentWindow.fileText) box.querySelector("div").insertBefore(taker(shown, box), apart); });
}

// Makes a button that copies the scenario set by a report's sliders into the editor.
function taker(frame, box) {
  const button = document.createElement("button");
  button.textContent = "To the editor";
  button.title = "Edit the scenario that the report shows";
  button.addEventListener("click", async () => {
    const text = frame.contentWindow.fileText(), own = box.dataset.document === doc.name;
    if (!(await room())) return;
    // In the document that was flown this is an edit, which can be undone.
    if (own) editor.setValue(text);
    else {
      show(box.dataset.document || "flown.toml", "", text);
      doc.saved = "";
      named();
    }
  });
  return button;
}

// Makes a form that flies one run of a campaign again.
function again(job) {
  const form = document.createElement("form");
  form.innerHTML = `<select aria-label="law">${job.laws.map((law) => `<option>${plain(law)}</option>`).join("")}</select>`
    + '<input type="number" min="0" step="1" value="0" aria-label="run"><button>Fly run again</button>';
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    started(await ask(`/jobs/${job.number}/again`, { law: form.querySelector("select").value, run: form.querySelector("input").value }), doc.name);
  });
  return form;
}

let watching = false;
async function watch() {
  if (watching) return;
  watching = true;
  for (let working = true; working;) {
    const { list } = await ask("/jobs");
    list.forEach(update);
    working = list.some((job) => !job.ended);
    if (working) await new Promise((done) => { setTimeout(done, 250); });
  }
  watching = false;
}

// --- the page ---

function options(box, title, items) {
  box.innerHTML = `<option value="">${title}</option>` + items.map(({ name, text }) => `<option value="${plain(name)}" title="${plain(text || "")}">${plain(name)}</option>`).join("");
}

function append(table) {
  const text = editor.getValue();
  editor.setValue(`${text.trimEnd()}\n\n${table}`);
  editor.setCursor(editor.lineCount(), 0);
}

async function open_() {
  known = await ask("/begin");
  editor = CodeMirror($("editor"), {
    value: known.text, mode: "toml", lineNumbers: true, lineWrapping: false,
    extraKeys: { "Ctrl-Space": (cm) => cm.showHint(), "Ctrl-S": () => { save(); }, "Cmd-S": () => { save(); } },
    hintOptions: { hint: completion, completeSingle: false },
  });
  editor.on("change", soon);
  editor.on("inputRead", (cm, change) => { if (/^[\w"[]$/.test(change.text[0])) cm.showHint(); });
  Object.assign(doc, { name: known.name, version: known.version, saved: known.text });
  named();
  options($("scenarios"), "open …", [...(known.own ? [{ name: known.own }] : []), ...known.scenarios.map((name) => ({ name }))]);
  options($("laws"), "add a law …", known.laws);
  options($("parts"), "add a part …", known.parts);
  $("scenarios").addEventListener("change", async ({ target }) => {
    const name = target.value;
    target.value = "";
    if (!name || !(await room())) return;
    if (name === known.own) {
      const found = await ask("/file");
      if (found.error) say(found.error, "bad");
      else show(found.name, found.version, found.text);
    } else show(`${name}.toml`, "", await (await fetch(`/builtin/${name}`)).text());
  });
  for (const name of ["laws", "parts"]) {
    $(name).addEventListener("change", ({ target }) => {
      const found = known[name].find((one) => one.name === target.value);
      if (found) append(found.table);
      target.value = "";
    });
  }
  $("buttons").innerHTML = known.kinds.map((kind) => `<button type="button" data-kind="${kind}">${kind[0].toUpperCase()}${kind.slice(1)}</button>`).join("");
  $("buttons").addEventListener("click", ({ target }) => { if (target.dataset.kind) begin(target.dataset.kind); });
  await check();
  (await ask("/jobs")).list.forEach((job) => { place(job); update(job); });
  watch();
}

$("save").addEventListener("click", () => { save(); });
$("wide").addEventListener("click", ({ target }) => {
  const on = document.body.classList.toggle("wide");
  target.textContent = on ? "Show the editor" : "Hide the editor";
  target.setAttribute("aria-pressed", String(on));
  editor.refresh();
});
$("beside").addEventListener("change", ({ target }) => $("results").classList.toggle("beside", target.checked));
addEventListener("beforeunload", (event) => { if (edited()) event.preventDefault(); });
open_();
