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

// --- completion: keys of the table that the cursor is in, words of the key that it follows ---

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

// --- errors at the key ---

let checking = 0;
let checked = "";
function soon() {
  clearTimeout(checking);
  checking = setTimeout(check, 300);
}

async function check() {
  const text = editor.getValue();
  const found = await ask("/check", { text });
  if (text !== editor.getValue()) return;
  checked = text;
  tell(found);
}

function tell(found) {
  if (wrong !== null) editor.removeLineClass(wrong, "background", "wrong-line");
  wrong = null;
  const verdict = $("verdict");
  verdict.classList.toggle("bad", Boolean(found.error));
  verdict.textContent = found.error || `${found.name}: ${found.laws.join(", ")}`;
  if (found.line) wrong = editor.addLineClass(found.line - 1, "background", "wrong-line");
}

// --- jobs ---

const boxes = new Map();

async function begin(kind) {
  // What is wrong is said here, where it can be seen; the server would refuse it likewise.
  if (checked !== editor.getValue()) await check();
  if ($("verdict").classList.contains("bad")) return;
  const found = await ask("/jobs", { kind, text: editor.getValue() });
  if (!found.ok) {
    tell(found);
    return;
  }
  place(found);
  watch();
}

function place(job) {
  document.querySelector("#results .hint")?.remove();
  const box = document.createElement("div");
  box.className = "result";
  box.innerHTML = `<div><b>${plain(job.kind)}</b><span class="said"></span><progress></progress><button type="button">Stop</button></div>`;
  box.querySelector("button").addEventListener("click", () => {
    if (box.dataset.ended) {
      box.remove();
      boxes.delete(job.number);
    } else ask(`/jobs/${job.number}/stop`, {});
  });
  $("results").prepend(box);
  boxes.set(job.number, box);
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
  shown.addEventListener("load", () => { if (shown.contentWindow && shown.contentWindow.fileText) box.querySelector("div").insertBefore(taker(shown), apart); });
}

// What a report's sliders say, as the scenario that is edited.
function taker(frame) {
  const button = document.createElement("button");
  button.textContent = "To the editor";
  button.title = "Edit the scenario of what the report shows";
  button.addEventListener("click", () => editor.setValue(frame.contentWindow.fileText()));
  return button;
}

let watching = false;
async function watch() {
  if (watching) return;
  watching = true;
  for (let busy = true; busy;) {
    const { list } = await ask("/jobs");
    list.forEach(update);
    busy = list.some((job) => !job.ended);
    if (busy) await new Promise((done) => { setTimeout(done, 250); });
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
  $("file").textContent = known.file || "no file";
  $("save").disabled = !known.file;
  editor = CodeMirror($("editor"), {
    value: known.text, mode: "toml", lineNumbers: true, lineWrapping: false,
    extraKeys: { "Ctrl-Space": (cm) => cm.showHint(), "Ctrl-S": save, "Cmd-S": save },
    hintOptions: { hint: completion, completeSingle: false },
  });
  editor.on("change", soon);
  editor.on("inputRead", (cm, change) => { if (/^[\w"[]$/.test(change.text[0])) cm.showHint(); });
  options($("scenarios"), "begin with …", known.scenarios.map((name) => ({ name })));
  options($("laws"), "add a law …", known.laws);
  options($("parts"), "add a part …", known.parts);
  $("scenarios").addEventListener("change", async ({ target }) => {
    if (target.value) editor.setValue(await (await fetch(`/builtin/${target.value}`)).text());
    target.value = "";
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

async function save() {
  const found = await ask("/save", { text: editor.getValue() });
  const verdict = $("verdict");
  verdict.classList.toggle("bad", Boolean(found.error));
  verdict.textContent = found.error || `saved ${found.saved}`;
}

$("save").addEventListener("click", save);
open_();
