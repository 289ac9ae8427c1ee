// Tables wider than the screen fade out at the edge towards hidden columns, and say so.
for (const box of document.querySelectorAll(".wide")) {
  const hint = document.createElement("p");
  hint.className = "note hint";
  hint.textContent = "Scroll the table sideways for more columns \u2192";
  hint.hidden = true;
  box.before(hint);
  const look = () => {
    const left = box.scrollWidth - box.clientWidth;
    box.classList.toggle("more", left - box.scrollLeft > 2);
    hint.hidden = left <= 2;
  };
  box.addEventListener("scroll", look, { passive: true });
  box.tabIndex = 0;
  new ResizeObserver(look).observe(box);
  look();
}
