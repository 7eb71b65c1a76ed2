// Tables of class "live": sorted by their heads, filtered by words, columns on demand, saved.

const Tables = new Map(); // by id

/** Make all tables of a place live. */
function setUpTables(root = document) {
  root.querySelectorAll("table.live").forEach((table, i) => {
    if (Tables.has(table.id) && Tables.get(table.id).table === table) return;
    table.id ||= `table-${slug(table.dataset.name ?? "")}-${i + 1}`;
    setUpTable(table);
  });
}

function setUpTable(table) {
  const head = headOf(table);
  const rows = [...table.tBodies].flatMap((body) => [...body.rows]);
  rows.forEach((row, i) => (row.dataset.place = i));
  const live = { table, head, rows, id: table.id, name: table.dataset.name ?? table.id };
  Tables.set(table.id, live);
  [...head.cells].forEach((cell, column) => setUpHead(live, cell, column));
  markMore(live);
  const scroll = table.parentElement.classList.contains("scroll") ? table.parentElement : table;
  if (scroll !== table) reachable(scroll, live.name);
  scroll.before(tools(live));
  showTable(live);
}

/** The row of heads, in a thead of its own if it has none. */
function headOf(table) {
  const head = table.tHead ?? table.createTHead();
  if (!head.rows.length) head.append(table.tBodies[0].rows[0]);
  return head.rows[head.rows.length - 1];
}

/** What scrolls must be reached by keyboard. */
function reachable(scroll, name) {
  scroll.setAttribute("tabindex", "0");
  scroll.setAttribute("role", "region");
  scroll.setAttribute("aria-label", `Table ${name}`);
  const hint = () =>
    scroll.classList.toggle("beyond", scroll.scrollLeft + scroll.clientWidth < scroll.scrollWidth - 2);
  scroll.addEventListener("scroll", hint, { passive: true });
  const watch = new ResizeObserver(hint);
  watch.observe(scroll);
  for (const child of scroll.children) watch.observe(child);
}

function setUpHead(live, cell, column) {
  cell.setAttribute("scope", "col");
  if (cell.hasAttribute("data-fixed") || !cell.textContent.trim()) return;
  const button = el("button", { type: "button", class: "sort", onclick: () => nextOrder(live, column) });
  // Of a head with a link in it only the mark is pressed: no control lies inside another.
  if (cell.querySelector("a, button")) button.setAttribute("aria-label", `Sort by ${headText(cell)}`);
  else button.append(...cell.childNodes);
  if (cell.dataset.term) {
    button.dataset.term = cell.dataset.term;
    delete cell.dataset.term;
  }
  cell.append(button);
}

/** By turns: upwards, downwards, as it came; numbers that are better large begin downwards. */
function nextOrder(live, column) {
  const key = `sort.${live.id}`;
  const first = live.head.cells[column].dataset.order === "down" ? "d" : "a";
  const orders = [`${column}${first}`, `${column}${first === "a" ? "d" : "a"}`, null];
  State.set({ [key]: orders[orders.indexOf(State.get(key)) + 1] ?? null });
}

/** What a cell is sorted by and saved as: a number where it is one. */
function valueOf(cell) {
  return asValue(cell.dataset.value ?? cell.textContent.trim());
}

function asValue(text) {
  if (/^[-+]?(inf|infinity|∞)$/i.test(text)) return text.startsWith("-") ? -Infinity : Infinity;
  const plain = text.replaceAll("−", "-");
  if (plain === "" || plain === "–" || plain === "nan" || plain === "None") return null;
  return Number.isFinite(Number(plain)) ? Number(plain) : text;
}

/** Compare two values: numbers before words, nothing last whatever the order. */
function compareValues(a, b, way) {
  if (a === null || b === null) return (a === null) - (b === null);
  if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1;
  return way * (typeof a === "number" ? a - b || 0 : a.localeCompare(b, "en", { numeric: true }));
}

/** Show a table as the state says: order, filter, columns. */
function showTable(live) {
  sortRows(live, State.get(`sort.${live.id}`));
  filterRows(live, State.get(`find.${live.id}`));
  live.table.classList.toggle("all", State.get(`all.${live.id}`) === "1");
  showTools(live);
}

function sortRows(live, order) {
  const [, column, way] = /^(\d+)([ad])$/.exec(order) ?? [];
  [...live.head.cells].forEach((cell, i) => {
    const mine = column !== undefined && i === Number(column);
    if (mine) cell.setAttribute("aria-sort", way === "a" ? "ascending" : "descending");
    else cell.removeAttribute("aria-sort");
  });
  const key = (row) => (row.cells[column] ? valueOf(row.cells[column]) : null);
  const sign = way === "d" ? -1 : 1;
  const place = (row) => Number(row.dataset.place);
  const sorted = [...live.rows].sort((a, b) =>
    (column === undefined ? 0 : compareValues(key(a), key(b), sign)) || place(a) - place(b),
  );
  for (const row of sorted) row.parentElement.append(row);
}

/** Keep the rows that have all words of the filter. */
function filterRows(live, words) {
  const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
  for (const row of live.rows) {
    const text = row.textContent.toLowerCase();
    row.classList.toggle("miss", !wanted.every((word) => text.includes(word)));
  }
}

/** Columns on demand: of a head with data-more, and the cells below. */
function markMore(live) {
  const more = [...live.head.cells].map((cell) => cell.hasAttribute("data-more"));
  const again = [...live.head.cells].map((cell) => cell.dataset.more === "again"); // said elsewhere too
  live.hasMore = more.includes(true);
  for (const row of [live.head, ...live.rows])
    [...row.cells].forEach((cell, i) => {
      cell.classList.toggle("more", more[i] === true);
      cell.classList.toggle("again", again[i] === true);
    });
}

/** Filter, columns, copy and save, above a table. */
function tools(live) {
  const find = el("input", {
    type: "search", placeholder: "filter rows", "aria-label": `Filter rows of ${live.name}`,
    oninput: () => State.set({ [`find.${live.id}`]: find.value }, { quietly: true }),
  });
  const all = el("button", {
    type: "button", class: "small", "aria-pressed": "false", text: "All columns",
    onclick: () => State.set({ [`all.${live.id}`]: live.table.classList.contains("all") ? null : "1" }),
  });
  all.hidden = !live.hasMore;
  const count = el("span", { class: "count", role: "status" });
  Object.assign(live, { find, all, count });
  const few = live.rows.length < 6;
  return el("div", { class: "tools" }, few ? null : find, count, all, saveMenu(live));
}

function showTools(live) {
  const words = State.get(`find.${live.id}`);
  if (live.find.value !== words) live.find.value = words;
  live.all.setAttribute("aria-pressed", String(live.table.classList.contains("all")));
  const shown = live.rows.filter(isShown).length;
  const rows = shown === live.rows.length ? [] : [`${shown} of ${live.rows.length} rows`];
  const whole = groupShown() && !live.table.closest("[data-group]") && !live.table.querySelector("[data-group]");
  live.count.textContent = [...rows, ...(whole ? [`of all ${groupsCalled()}s`] : [])].join(", ");
}

const isShown = (part) => !["miss", "gone", "other"].some((name) => part.classList.contains(name));
