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

/** Everyone on the page, in the order of the looks. */
const everyone = () => Object.keys(looks);

/** What the page calls them: its lines may be of measurements and models. */
const called = () => document.body.dataset.called ?? "Estimators";

function whoMenu() {
  if (everyone().length < 2) return null;
  const boxes = everyone().map((who) =>
    el("label", {}, el("input", {
      type: "checkbox", "data-toggle": who, onchange: (e) => State.toggle("hide", who, !e.target.checked),
    }), swatch({ who }), el("span", { text: who })),
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

/** Show in bar, tables and text who and which group the state says; charts look themselves. */
function showParts() {
  for (const part of document.querySelectorAll("[data-who]"))
    if (part.namespaceURI !== SVG_NS) part.classList.toggle("gone", absent(part.dataset.who));
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
