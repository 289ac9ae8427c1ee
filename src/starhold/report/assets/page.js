// What all scripts of a page share: the data, and the colours of the page.
"use strict";

const report = JSON.parse(document.getElementById("data").textContent);
if (document.getElementById("living")) report.living = JSON.parse(document.getElementById("living").textContent);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
// What reads names as HTML is given what comes from files as it stands.
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;").replace(/"/g, "&quot;");
const dark = matchMedia("(prefers-color-scheme: dark)");
// Buttons that lead to a fold open it.
document.addEventListener("click", ({ target }) => {
  const fold = target.dataset.open && document.getElementById(target.dataset.open);
  if (!fold) return;
  fold.open = true;
  fold.scrollIntoView({ behavior: "smooth" });
});
