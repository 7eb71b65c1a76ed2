// Everything is set up here, once the page is read.

/** Who listens to what of the state. */
function showChanges(keys) {
  const charts = keys.filter((key) => key.startsWith("win.")).map((key) => key.slice(4));
  if (keys.some((key) => key === "hide" || key === "group")) {
    showParts();
    redrawFigures();
    for (const live of Tables.values()) showTable(live);
  } else charts.forEach((name) => Figures.has(name) && Figures.get(name).draw());
  for (const id of keys.filter((key) => /^(sort|find|all)\./.test(key)).map((key) => key.replace(/^\w+\./, "")))
    if (Tables.has(id)) showTable(Tables.get(id));
  if (keys.includes("pick")) showPick();
}

/** Draw all for paper, whatever has been near the screen. */
function setUpPrint() {
  window.addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("main details:not([open], .menu)")) {
      if (details.querySelector("table.live")) continue; // folded, for it is long
      details.open = true;
      details.dataset.opened = "";
    }
    [...waiting.keys()].forEach(drawNow);
  });
  window.addEventListener("afterprint", () => {
    for (const details of document.querySelectorAll("details[data-opened]")) {
      details.open = false;
      delete details.dataset.opened;
    }
  });
}

function setUpResize() {
  let width = document.documentElement.clientWidth;
  let timer = 0;
  window.addEventListener("resize", () => {
    if (document.documentElement.clientWidth === width) return;
    width = document.documentElement.clientWidth;
    clearTimeout(timer);
    timer = setTimeout(() => redrawFigures(), 120);
  });
}

/** Go on with tables alone where a browser is too old to unpack the rest. */
function withoutCharts() {
  remark("This browser is too old for the charts of this page; its tables are whole.");
  return EMPTY;
}

const remark = (words) =>
  document.querySelector("main").prepend(el("p", { class: "note", role: "alert", text: words }));

/** Whether colours have a light and a dark variant; else the style sheet has the light ones alone. */
const twoColours = () => window.CSS?.supports?.("color", "light-dark(#000, #fff)") ?? false;

async function start() {
  document.documentElement.classList.add("scripted");
  if (!twoColours()) remark("This browser is too old for dark colours; a newer one has both.");
  document.body.append(el("p", { id: "said", class: "unseen", "aria-live": "polite" }));
  State.read();
  setUpTables();
  document.querySelectorAll("pre.command").forEach(command);
  followAnchors();
  setUpPrint();
  setUpResize();
  document.addEventListener("click", closeMenus);
  const given = await unpacked().catch(withoutCharts);
  ({ picks, looks, terms } = given);
  if (given.aside.length) State.first.set("hide", given.aside.map(encodeURIComponent).join("|"));
  fillSwatches();
  setUpPicks();
  setUpTerms();
  setUpBar();
  showParts();
  for (const live of Tables.values()) showTools(live);
  for (const [name, chart] of Object.entries(given.charts)) {
    const place = document.getElementById(name);
    if (place) setUpFigure(place, chart);
  }
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
