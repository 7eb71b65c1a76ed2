// How an estimator looks: colour, dash and marker, as `reporting/looks.py` gives it to the page.

const MARKERS = {
  o: "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z",
  s: "M-3.5,-3.5h7v7h-7z",
  D: "M0,-5L5,0L0,5L-5,0z",
  "^": "M0,-4.8L4.6,3.6H-4.6z",
  v: "M0,4.8L4.6,-3.6H-4.6z",
  P: "M-1.6,-4.6h3.2v3h3v3.2h-3v3h-3.2v-3h-3v-3.2h3z",
  X: "M-4.6,-2.6L-2.6,-4.6L0,-2L2.6,-4.6L4.6,-2.6L2,0L4.6,2.6L2.6,4.6L0,2L-2.6,4.6L-4.6,2.6L-2,0z",
  "*": "M0,-5.4L1.4,-1.7H5.2L2.2,0.7L3.3,4.5L0,2.3L-3.3,4.5L-2.2,0.7L-5.2,-1.7H-1.4z",
  "<": "M-4.8,0L3.6,4.6V-4.6z",
};
const ROLES = {
  truth: { colour: "var(--text)", dash: "5 3", width: 1.3 },
  bound: { colour: "var(--text)", dash: "1.5 3", width: 1.1 },
  data: { colour: "var(--muted)", dash: "", width: 1.2 },
  estimate: { colour: "var(--muted)", dash: "", width: 1.5 },
};

// The second, third bound of a chart, where it has more than one.
const BOUNDS = [
  ROLES.bound,
  { colour: "var(--muted)", dash: "9 3 1.5 3", width: 1.8 },
  { colour: "var(--text)", dash: "1 5", width: 2.2 },
];

let looks = {}; // by estimator as typed

/** Let bounds of different names in a chart look different: give each its number. */
function numberBounds(chart) {
  const bounds = (chart.xs ? [] : chart.panels).flatMap((p) => p.lines.filter((line) => line.role === "bound"));
  const names = [...new Set(bounds.map((line) => line.label))];
  for (const line of bounds) line.nth = names.indexOf(line.label);
}

const ofRole = (line) =>
  line.role === "bound" ? BOUNDS[(line.nth ?? 0) % BOUNDS.length] : ROLES[line.role ?? "estimate"];

/** The look of a line: that of its estimator, else of its role. */
function lookOf(line) {
  const look = looks[line.who];
  if (!look) return { ...ofRole(line), marker: "o", hollow: true };
  const base = { colour: `var(--look-${look.place})`, dash: look.dash, width: 1.6 };
  const role = line.role && line.role !== "estimate" ? { dash: ofRole(line).dash, width: 1.1 } : {};
  return { ...base, marker: look.marker, hollow: look.hollow, ...role };
}

/** A marker at a place. */
function markerAt(look, x, y, attributes = {}) {
  return svg("path", {
    d: MARKERS[look.marker],
    transform: `translate(${x.toFixed(1)},${y.toFixed(1)})`,
    fill: look.hollow ? "var(--back)" : look.colour,
    stroke: look.colour,
    "stroke-width": look.hollow ? 1.4 : 0.5,
    ...attributes,
  });
}

/** A short piece of the line with its marker, for legends and tables. */
function swatch(line) {
  const look = lookOf(line);
  const marked = Boolean(looks[line.who]) || line.kind === "points" || line.kind === "both";
  return svg(
    "svg",
    { class: "swatch", viewBox: "0 0 30 12", width: 30, height: 12, "aria-hidden": "true" },
    line.kind === "points" && !looks[line.who]
      ? null
      : svg("path", {
          d: "M1,6H29", stroke: look.colour, "stroke-width": 2, "stroke-dasharray": look.dash || null,
        }),
    marked ? markerAt(look, 15, 6) : null,
  );
}

/** Put a swatch into every place of the page that asks for one. */
function fillSwatches(root = document) {
  for (const place of root.querySelectorAll("[data-look]"))
    if (!place.firstChild) place.append(swatch({ who: place.dataset.look }));
}
