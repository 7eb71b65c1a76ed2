// What opens when a line or a point is clicked: facts, the command that repeats it, charts.

let picks = {}; // by name, as the page was given them

let cameFrom = null; // the address before one was opened here; null where a link opened it

/** Of names that come with an address: what every object has is no pick. */
const pickOf = (name) => (Object.hasOwn(picks, name) ? picks[name] : undefined);

/** Open one: as part of the state, so that a link opens it too. */
function openPick(name) {
  if (!pickOf(name)) return;
  if (!State.get("pick")) cameFrom = State.fragment({});
  State.set({ pick: name });
}

/** Show in the dialog what the state says, or close it. */
function showPick() {
  const dialog = document.getElementById("picked");
  const found = pickOf(State.get("pick"));
  if (!found) return dialog.open && dialog.close();
  dialog.replaceChildren(...pickParts(found));
  if (!dialog.open) dialog.showModal();
  for (const place of dialog.querySelectorAll("[data-chart]"))
    setUpFigure(place, found.charts[Number(place.dataset.chart.split(".")[1])]);
}

function pickParts(found) {
  const facts = (found.facts ?? []).flatMap(([term, text]) => [
    el("dt", { symbols: term }), el("dd", { symbols: text }),
  ]);
  const charts = (found.charts ?? []).flatMap((chart, i) => [
    el("h3", { symbols: chart.title }), el("figure", { "data-chart": `pick.${i}` }),
    el("p", { class: "muted", symbols: chart.words }),
  ]);
  return [
    el("button", { type: "button", class: "close", "aria-label": "Close", text: "×", onclick: closePick }),
    el("h2", { id: "picked-title", symbols: found.title }),
    found.words ? el("p", { symbols: found.words }) : null,
    facts.length ? el("dl", { class: "facts" }, ...facts) : null,
    found.command ? command(el("pre", { class: "command", text: found.command })) : null,
    ...charts,
  ].filter(Boolean);
}

/** Close it as going back does, where that shows what is shown now: it shall not open once more. */
function closePick() {
  const zooms = [...State.values.keys()].filter((key) => key.startsWith("win.pick."));
  const changes = Object.fromEntries(["pick", ...zooms].map((key) => [key, null]));
  document.getElementById("picked").close();
  if (State.fragment(changes) === cameFrom) window.history.back();
  else State.set(changes, { quietly: true });
  cameFrom = null;
}

function setUpPicks() {
  const dialog = el("dialog", { id: "picked", "aria-labelledby": "picked-title" });
  dialog.addEventListener("cancel", (event) => (event.preventDefault(), closePick()));
  dialog.addEventListener("click", (event) => event.target === dialog && closePick());
  document.body.append(dialog);
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("[data-opens]");
    if (link) openPick(link.dataset.opens);
  });
}

/** A command with a button to copy it. */
function command(pre) {
  const text = pre.textContent.trim();
  const box = el("div", { class: "command" });
  pre.replaceWith(box);
  box.append(pre, copyButton("Copy", () => text));
  return box;
}
