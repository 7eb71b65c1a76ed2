// What a word means, by hover and by keyboard: of every element with data-term.

let terms = {}; // by term, as the page was given them

function setUpTerms() {
  const tip = el("div", { id: "term-tip", class: "tip term-tip", role: "tooltip", hidden: true });
  document.body.append(tip);
  for (const place of document.querySelectorAll("[data-term]")) reachableTerm(place);
  const show = (event) => showTerm(tip, event.target.closest?.("[data-term]"));
  document.addEventListener("pointerover", show);
  document.addEventListener("focusin", show);
  document.addEventListener("keydown", (event) => event.key === "Escape" && (tip.hidden = true));
  document.addEventListener("focusout", () => (tip.hidden = true));
}

function reachableTerm(place) {
  if (!terms[place.dataset.term]) return;
  if (place.tagName !== "BUTTON") place.setAttribute("tabindex", "0");
  place.setAttribute("aria-describedby", "term-tip");
}

function showTerm(tip, place) {
  const words = place && terms[place.dataset.term];
  tip.hidden = !words;
  if (!words) return;
  tip.replaceChildren();
  typeset(tip, words);
  const box = place.getBoundingClientRect();
  const wide = Math.min(340, document.documentElement.clientWidth - 16);
  tip.style.width = `${wide}px`;
  tip.style.left = `${Math.max(8, Math.min(box.left, document.documentElement.clientWidth - wide - 8))}px`;
  const above = box.bottom + tip.offsetHeight + 12 > window.innerHeight;
  tip.style.top = `${above ? box.top - tip.offsetHeight - 6 : box.bottom + 6}px`;
}
