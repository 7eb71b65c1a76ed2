// The bar on top: contents, estimators, group, light or dark, a link to what is shown.

function setUpBar() {
  const contents = contentsMenu();
  const link = copyButton("Copy link", () => window.location.href);
  link.classList.add("link");
  const bar = el(
    "nav", { class: "bar", "aria-label": "This page" },
    contents, whoMenu(), groupChoice(), el("span", { class: "gap" }),
    link, twoColours() ? themeButton() : null,
  );
  document.querySelector("main").before(bar); // behind the link to skip it
}

/** A list of the headings to jump to. */
function contentsMenu() {
  const heads = [...document.querySelectorAll("main :is(h2, h3)")].filter((h) => h.textContent.trim());
  if (heads.length < 2) return null;
  const links = heads.map((head) => {
    head.id ||= freeId(slug(head.textContent));
    return el("li", { class: head.tagName.toLowerCase() }, el("a", { href: `#${head.id}`, text: head.textContent.trim() }));
  });
  const found = menu("Contents", "Contents of this page", el("ul", {}, ...links));
  found.addEventListener("click", (event) => event.target.tagName === "A" && (found.open = false));
  return found;
}

function freeId(wanted) {
  let id = wanted;
  for (let n = 2; document.getElementById(id); n++) id = `${wanted}-${n}`;
  return id;
}

let everyoneHere = []; // on the page, in the order of the registry
const everyone = () => everyoneHere;

/** What the page calls them: its lines may be of measurements and models. */
const called = () => document.body.dataset.called ?? "Estimators";

function whoMenu() {
  if (everyone().length < 2) return null;
  const boxes = everyone().map((who) =>
    el("label", {}, el("input", {
      type: "checkbox", "data-toggle": who, onchange: (e) => State.toggle("hide", who, !e.target.checked),
    }), swatch(who), el("span", { text: who })),
  );
  const set = (text, members) =>
    el("button", { type: "button", class: "small", text, onclick: () => State.setList("hide", members()) });
  return menu(
    called(), `${called()} shown`, el("div", { class: "pair" }, set("All", () => []), set("None", everyone)), ...boxes,
  );
}

function groupChoice() {
  const groups = groupsOfPage();
  if (groups.length < 2) return null;
  const select = el(
    "select", { id: "group-choice", onchange: () => State.set({ group: select.value }) },
    el("option", { value: "", text: `all ${groupsCalled()}s` }),
    ...groups.map((group) => el("option", { value: group, text: group })),
  );
  return el("label", { class: "group" }, el("span", { text: groupsCalled() }), select);
}

/** What groups are called here: those of a run are tracks. */
const groupsCalled = () => document.body.dataset.groups ?? "group";

const groupsOfPage = () =>
  [...new Set([...document.querySelectorAll("[data-group]")].map((e) => e.dataset.group))].filter(Boolean);

/** The group that is shown alone; none where the address names one that is not here. */
const groupShown = () => (groupsOfPage().includes(State.get("group")) ? State.get("group") : "");

/** What is only too much for charts at first stays in tables. */
const absent = (who) => hidden(who) && !State.isFirst("hide", who);

/** Show in bar, tables and charts who and which group the state says. */
function showParts() {
  for (const part of document.querySelectorAll("[data-who]"))
    part.classList.toggle("gone", (part.closest("figure.chart") ? hidden : absent)(part.dataset.who));
  for (const button of document.querySelectorAll("button[data-toggle]"))
    button.setAttribute("aria-pressed", String(!hidden(button.dataset.toggle)));
  const group = groupShown();
  for (const part of document.querySelectorAll("[data-group]"))
    part.classList.toggle("other", group !== "" && part.dataset.group !== group);
  for (const box of document.querySelectorAll("input[data-toggle]"))
    box.checked = !hidden(box.dataset.toggle);
  const select = document.getElementById("group-choice");
  if (select) select.value = group;
  const count = everyone().filter(hidden).length;
  const summary = document.querySelector(`.bar summary[aria-label^="${called()}"]`);
  if (summary) summary.textContent = count ? `${called()} (${count} hidden)` : called();
}

/** Light or dark: as the system has it, or the other, which is kept where the browser keeps it. */
function themeButton() {
  const root = document.documentElement;
  const system = window.matchMedia("(prefers-color-scheme: dark)");
  const ofSystem = () => (system.matches ? "dark" : "light");
  const other = () => ((root.dataset.theme || ofSystem()) === "dark" ? "light" : "dark");
  const button = el("button", { type: "button", class: "small theme" });
  const set = (theme) => {
    root.dataset.theme = theme;
    button.textContent = other() === "dark" ? "Dark" : "Light";
    button.setAttribute("aria-label", `Change to ${other()} colours`);
  };
  button.addEventListener("click", () => {
    const next = other() === ofSystem() ? "" : other();
    kept("flexaxis-theme", next);
    set(next);
  });
  system.addEventListener("change", () => set(root.dataset.theme));
  set(kept("flexaxis-theme"));
  return button;
}

/** Keep a value, or return the one kept; a page from a file may not be allowed to. */
function kept(key, value) {
  try {
    if (value !== undefined) window.localStorage.setItem(key, value);
    const found = window.localStorage.getItem(key);
    return found === "dark" || found === "light" ? found : "";
  } catch {
    return "";
  }
}

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
