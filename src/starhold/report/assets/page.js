// The data and the colours that all scripts of a page share.
"use strict";

const report = JSON.parse(document.getElementById("data").textContent);
if (document.getElementById("living")) report.living = JSON.parse(document.getElementById("living").textContent);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// Escapes text from files for functions that read names as HTML.
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;").replace(/"/g, "&quot;");
const dark = matchMedia("(prefers-color-scheme: dark)");
// A button that leads to a fold opens it.
document.addEventListener("click", ({ target }) => {
  const fold = target.dataset.open && document.getElementById(target.dataset.open);
  if (!fold) return;
  fold.open = true;
  fold.scrollIntoView({ behavior: "smooth" });
});
