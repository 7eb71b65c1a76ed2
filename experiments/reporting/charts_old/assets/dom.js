// Making elements: everything from data becomes text, never markup.

const SVG_NS = "http://www.w3.org/2000/svg";
// A letter with an index, as f_m or θ_1, that is no part of a longer word.
const SYMBOL = pattern("(?<![\\w-])([A-Za-zΔθσψεμλτ])_([A-Za-z0-9θ]{1,3})(?![\\w-])");

/** A pattern; in a browser too old to know it, one that is nowhere: the page goes on and says so. */
function pattern(text) {
  try {
    return new RegExp(text, "u");
  } catch {
    return /(?!)/;
  }
}

/** Give an element attributes, handlers (on…), properties of text, and children. */
function dress(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "text") node.textContent = value;
    else if (name === "symbols") typeset(node, value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

const el = (tag, attributes = {}, ...children) =>
  dress(document.createElement(tag), attributes, children);

const svg = (tag, attributes = {}, ...children) =>
  dress(document.createElementNS(SVG_NS, tag), attributes, children);

/** Put text into an element, with symbols as letter and index. */
function typeset(node, text) {
  const inSvg = node.namespaceURI === SVG_NS;
  let sunk = false; // whether an index has moved the line of text in SVG down
  for (const [kind, part] of pieces(String(text))) {
    if (!inSvg) node.append(kind ? el(kind, { text: part }) : part);
    else node.append(svg("tspan", { ...styleOf(kind, sunk), text: part }));
    sunk = kind === "sub";
  }
  return node;
}

/** Cut text into pairs of a tag, "i" or "sub" or none, and text. */
function pieces(text) {
  const found = [];
  let rest = text;
  for (let hit = SYMBOL.exec(rest); hit; hit = SYMBOL.exec(rest)) {
    found.push(["", rest.slice(0, hit.index)], ["i", hit[1]], ["sub", hit[2]]);
    rest = rest.slice(hit.index + hit[0].length);
  }
  return [...found, ["", rest]].filter(([, part]) => part);
}

function styleOf(kind, sunk) {
  if (kind === "sub") return { dy: "0.28em", "font-size": "75%" };
  return { "font-style": kind === "i" ? "italic" : null, dy: sunk ? "-0.21em" : null };
}

/** A number for people: four digits, and no exponent where none is needed. */
function digits(value, count = 4) {
  if (value === null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) return minus(value.toExponential(count - 2));
  return minus(String(Number(value.toPrecision(count))));
}

const minus = (text) => text.replaceAll("-", "−");

/** Name what is drawn, for the fragment and for anchors. */
const slug = (text) =>
  text.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || "x";

/** Put text on the clipboard; of a page from a file the first way is not always allowed. */
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = el("textarea", { class: "unseen", "aria-hidden": "true" });
    area.value = text;
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    return done;
  }
}

/** A button that copies what a function returns, and says so. */
function copyButton(label, source) {
  const button = el("button", { type: "button", class: "small", text: label });
  button.addEventListener("click", async () => {
    const done = await copyText(source());
    button.textContent = done ? "Copied" : "Not allowed";
    say(done ? "Copied" : "The browser does not allow to copy");
    setTimeout(() => (button.textContent = label), 1500);
  });
  return button;
}

/** Let a screen reader say something. */
function say(text) {
  document.getElementById("said").textContent = text;
}

/** Let the browser save text as a file. */
function download(name, text, type) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
