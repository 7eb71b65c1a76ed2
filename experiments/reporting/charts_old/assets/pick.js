// What opens when a line or a point is clicked: facts, the command that repeats it, charts.

let picks = {}; // by name: HTML, deflated, in base64

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
async function showPick() {
  const dialog = document.getElementById("picked");
  const found = pickOf(State.get("pick"));
  if (!found) return dialog.open && dialog.close();
  const close = el("button", { type: "button", class: "close", "aria-label": "Close", text: "×", onclick: closePick });
  dialog.replaceChildren(close, ...(await unpacked(found).catch(tooOld)));
  if (!dialog.open) dialog.showModal();
  dialog.querySelectorAll("pre.command").forEach(command);
  dialog.querySelectorAll("figure.chart").forEach(setUpFigure);
  showParts();
}

/** The elements that were packed: written by the page's maker, everything from data escaped there. */
async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const html = await new Response(stream).text();
  return [...new DOMParser().parseFromString(html, "text/html").body.childNodes];
}

/** Go on with the page alone where a browser is too old to unpack the rest. */
function tooOld() {
  return [el("p", { class: "note", role: "alert", text: "This browser is too old for single runs; the page is whole." })];
}

/** Close it as going back does, where that shows what is shown now: it shall not open once more. */
function closePick() {
  const zooms = [...State.values.keys()].filter((key) => key.startsWith("win.pick-"));
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
