// Charts as files: their values as CSV, what is seen of them as SVG.

// What the style sheet says of a part of a chart, and an SVG alone would not know.
const STYLES = ["fill", "stroke", "stroke-width", "stroke-dasharray", "opacity", "font-size", "font-family", "font-style"];

/** A menu to take a chart along. */
function chartMenu(figure) {
  const { chart, name } = figure;
  const item = (text, act) => el("button", { type: "button", class: "small", text, onclick: act });
  return menu(
    "Save", `Save chart ${chart.title}`,
    item("CSV of the curves", () => download(`${name}.csv`, separated(valuesOf(chart), ","), "text/csv")),
    ...(chart.xs ? [] : [item("SVG, as shown", () => savePictures(figure))]),
  );
}

/** All values of a chart, a row a point. */
const valuesOf = (chart) => (chart.xs ? cellsOf(chart) : pointsOf(chart));

function pointsOf(chart) {
  const sides = ["y", "low", "high", "x_low", "x_high"];
  const rows = chart.panels.flatMap((panel) => panel.lines.flatMap((line) =>
    [...line.x].map((x, i) => [panel.title ?? "", panel.y, line.who ?? "", line.label ?? "", number(x),
      ...sides.map((side) => number(line[side]?.[i]))]),
  ));
  return { heads: ["panel", "quantity", "estimator", "curve", chart.x, ...sides], rows };
}

function cellsOf(chart) {
  const rows = chart.panels.flatMap((panel) => panel.values.flatMap((row, j) =>
    [...row].map((value, i) => [panel.who || panel.title || "", chart.xs[i], chart.ys[j], number(value)]),
  ));
  return { heads: ["map", chart.x, chart.y, `value [${chart.unit ?? ""}]`], rows };
}

/** A number to six digits, as the page has it; what is none is nothing. */
const number = (v) => (v === undefined || v === null || Number.isNaN(v) ? null : Number(v.toPrecision(6)));

function savePictures(figure) {
  const pictures = figure.frame.querySelectorAll("svg.plot");
  pictures.forEach((picture, i) => {
    const name = pictures.length > 1 ? `${figure.name}-${i + 1}.svg` : `${figure.name}.svg`;
    download(name, alone(picture), "image/svg+xml");
  });
}

/** An SVG as a file of its own: with the styles that the page gives it. */
function alone(picture) {
  const copy = picture.cloneNode(true);
  const parts = picture.querySelectorAll("*");
  copy.querySelectorAll("*").forEach((part, i) => {
    const style = getComputedStyle(parts[i]);
    for (const name of STYLES) part.setAttribute(name, style.getPropertyValue(name));
    part.removeAttribute("class");
  });
  for (const empty of copy.querySelectorAll("path:not([d]), path[d='']")) empty.remove();
  copy.setAttribute("xmlns", SVG_NS);
  copy.style.background = getComputedStyle(document.body).backgroundColor;
  return new XMLSerializer().serializeToString(copy);
}
