// Everything is set up here, once the page is read.

/** Who listens to what of the state. */
function showChanges(keys) {
  if (keys.some((key) => key === "hide" || key === "group")) {
    showParts();
    for (const live of Tables.values()) showTable(live);
  }
  if (keys.some((key) => key.startsWith("win."))) for (const { views } of Figures.values()) views.forEach(zoomed);
  for (const id of keys.filter((key) => /^(sort|find|all)\./.test(key)).map((key) => key.replace(/^\w+\./, "")))
    if (Tables.has(id)) showTable(Tables.get(id));
  if (keys.includes("pick")) showPick();
}

/** On paper everything is open but what is long, and was folded for it. */
function setUpPrint() {
  window.addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("main details:not([open], .menu)")) {
      if (details.querySelector("table.live")) continue;
      details.open = true;
      details.dataset.opened = "";
    }
  });
  window.addEventListener("afterprint", () => {
    for (const details of document.querySelectorAll("details[data-opened]")) {
      details.open = false;
      delete details.dataset.opened;
    }
  });
}

/** The legends: a button hides its estimator in the whole page, and lights its curves up. */
function setUpLegends() {
  const button = (event) => event.target.closest?.("button[data-toggle]");
  document.addEventListener("click", (event) => {
    const found = button(event);
    if (found) State.toggle("hide", found.dataset.toggle, found.getAttribute("aria-pressed") === "true");
  });
  for (const [kind, on] of [["pointerover", true], ["focusin", true], ["pointerout", false], ["focusout", false]])
    document.addEventListener(kind, (event) => {
      const place = button(event)?.closest("figure.chart");
      if (place) highlight(place, on ? button(event).dataset.toggle : "");
    });
}

const remark = (words) =>
  document.querySelector("main").prepend(el("p", { class: "note", role: "alert", text: words }));

/** Whether colours have a light and a dark variant; else the style sheet has the light ones alone. */
const twoColours = () => window.CSS?.supports?.("color", "light-dark(#000, #fff)") ?? false;

function start() {
  document.documentElement.classList.add("scripted");
  if (!twoColours()) remark("This browser is too old for dark colours; a newer one has both.");
  document.body.append(el("p", { id: "said", class: "unseen", "aria-live": "polite" }));
  State.read();
  setUpTables();
  document.querySelectorAll("pre.command").forEach(command);
  followAnchors();
  setUpPrint();
  setUpLegends();
  document.addEventListener("click", closeMenus);
  const given = JSON.parse(document.getElementById("page-data").textContent);
  ({ picks, terms } = given);
  everyoneHere = given.everyone;
  if (given.aside.length) State.first.set("hide", given.aside.map(encodeURIComponent).join("|"));
  setUpPicks();
  setUpTerms();
  setUpBar();
  document.querySelectorAll("main figure.chart").forEach(setUpFigure);
  showParts();
  for (const live of Tables.values()) showTools(live);
  State.listen(showChanges);
  window.addEventListener("hashchange", () => {
    const before = State.get("at");
    State.read();
    if (State.get("at") !== before) goTo(State.get("at"));
  });
  showPick();
  goTo(State.get("at"));
  document.documentElement.dataset.ready = "yes";
}

start();
