// What is hidden, sorted, filtered, zoomed, opened: in the fragment of the address, so that a link
// shows what its sender saw and the back button goes back.

/** Keys: hide, group, pick, at (an anchor), and sort.ID, find.ID, all.ID, win.ID of what has an ID. */
const State = {
  values: new Map(),
  first: new Map(), // what holds of a key that the address does not name
  listeners: [],

  get: (key) => State.values.get(key) ?? State.first.get(key) ?? "",
  has: (key, one) => State.list(key).includes(one),
  list: (key) => State.get(key).split("|").filter(Boolean).map(decoded),

  /**
   * Change some; null or "" removes. `quietly` replaces the entry of the history; so does what
   * changes while a dialog is open, for it is one step to go back from.
   */
  set(changes, { quietly = false } = {}) {
    const text = State.fragment(changes);
    if (text === "#" + window.location.hash.slice(1)) return;
    if (quietly || (State.get("pick") && changes.pick === undefined)) window.location.replace(text);
    else window.location.hash = text;
    State.read();
  },

  /** What the address would say after changes. */
  fragment(changes) {
    const next = new Map(State.values);
    for (const [key, value] of Object.entries(changes)) {
      const given = value || (State.first.has(key) ? NOTHING : "");
      given && given !== State.first.get(key) ? next.set(key, given) : next.delete(key);
    }
    return "#" + [...next].map((pair) => pair.map(encodeURIComponent).join("=")).join("&");
  },

  /** Add a member to a list of a key, or take it away. */
  toggle(key, one, on) {
    const rest = State.list(key).filter((other) => other !== one);
    State.setList(key, on ? [...rest, one] : rest);
  },

  setList: (key, members) => State.set({ [key]: members.map(encodeURIComponent).join("|") }),

  /** Take over what the address says, and tell those who listen. */
  read() {
    const text = window.location.hash.slice(1);
    const plain = text && !text.includes("=");
    const pairs = plain ? [["at", decoded(text)]] : text.split("&").filter(Boolean).map(pairOf);
    const before = State.values;
    State.values = new Map(pairs);
    const keys = new Set([...before.keys(), ...State.values.keys()]);
    const changed = [...keys].filter((key) => before.get(key) !== State.values.get(key));
    if (changed.length) for (const listen of State.listeners) listen(changed);
  },

  /** Call a function with the keys that changed, whenever some did. */
  listen: (listener) => State.listeners.push(listener),
};

/** Whether a list has a member before anybody chose. */
State.isFirst = (key, one) =>
  (State.first.get(key) ?? "").split("|").some((each) => each !== "" && decodeURIComponent(each) === one);

const NOTHING = "-"; // an empty list, where an absent one means something else

const pairOf = (text) => {
  const cut = text.indexOf("=");
  return [decoded(text.slice(0, cut)), decoded(text.slice(cut + 1))];
};

/** Text of an address as it is meant; what is no such text stays as it is. */
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

const hidden = (who) => who !== "" && who !== undefined && State.has("hide", who);

/** Anchors keep the rest of the state: they are one part of it. */
function followAnchors() {
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.('a[href^="#"]');
    if (!link || event.metaKey || event.ctrlKey) return;
    event.preventDefault();
    const at = decoded(link.getAttribute("href").slice(1));
    State.set({ at });
    goTo(at);
  });
}

function goTo(at) {
  const target = at && document.getElementById(at);
  if (!target) return;
  if (target.closest(".other")) State.set({ group: null }, { quietly: true }); // asked for by name
  for (let part = target; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
  target.scrollIntoView();
  if (!target.hasAttribute("tabindex")) target.setAttribute("tabindex", "-1");
  target.focus({ preventScroll: true });
}
