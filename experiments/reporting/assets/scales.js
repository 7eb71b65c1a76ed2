// From values to pixels and back, and where ticks stand.

/** A scale: `to` pixels, `from` pixels, `ticks`. */
function scale([low, high], [begin, end], log = false) {
  const f = log ? Math.log : (v) => v;
  const back = log ? Math.exp : (v) => v;
  const a = f(low);
  const k = (end - begin) / (f(high) - a || 1);
  return {
    to: (value) => begin + (f(value) - a) * k,
    from: (pixel) => back(a + (pixel - begin) / k),
    ticks: log ? logTicks(low, high, Math.abs(end - begin)) : ticks(low, high, Math.abs(end - begin)),
    low, high, begin, end, log,
  };
}

/** Round values about every 70 pixels across, every 36 up. */
function ticks(low, high, pixels, apart = pixels > 300 ? 80 : 36) {
  const raw = (high - low) / Math.max(2, pixels / apart);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
  const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return found.map((value) => ({ value, text: minus((value === 0 ? 0 : value).toFixed(places)) }));
}

/** Decades and, where there is room, 2 and 5 between; of a narrow range round values. */
function logTicks(low, high, pixels) {
  const decades = Math.log10(high / low);
  if (decades < 0.7) return ticks(low, high, pixels);
  const parts = decades < 2.5 ? [1, 2, 5] : [1];
  const found = [];
  for (let p = Math.floor(Math.log10(low)); p <= Math.ceil(Math.log10(high)); p++)
    for (const part of parts) {
      const value = Number(`${part}e${p}`);
      if (value >= low * 0.999 && value <= high * 1.001) found.push({ value, text: digits(value, 3) });
    }
  return found;
}

/** The range of the middle share of values, so that a burst does not set the scale. */
function middle(values, share = 0.99) {
  const sorted = Float64Array.from(values).sort();
  const edge = Math.floor(((1 - share) / 2) * (sorted.length - 1));
  return [sorted[edge], sorted[sorted.length - 1 - edge]];
}

/** What a panel shows of y between two x: truth whole, estimates no farther than twice its range. */
function yRange(panel, lines, [from, to]) {
  if (panel.y_range) return panel.y_range;
  const certain = [], drawn = [];
  const outside = (v) => v < from || v > to;
  // Of steps the value before the view still holds in it.
  const enters = (line, i) => line.kind === "steps" && line.x[i] < from && !(line.x[i + 1] < from);
  for (const line of lines) {
    const points = line.kind === "points" || line.kind === "both";
    const target = points || line.role === "truth" ? certain : drawn;
    for (let i = 0; i < line.x.length; i++) {
      if (points ? outside(line.x[i]) : outside(line.x[i]) && !enters(line, i)) continue;
      const sides = points ? [line.y[i], line.low?.[i], line.high?.[i]] : [line.y[i]];
      for (const v of sides) if (Number.isFinite(v) && !(panel.y_log && v <= 0)) target.push(v);
    }
  }
  return panel.y_log ? logRoom(certain, drawn) : room(certain, drawn);
}

function room(certain, drawn) {
  if (!certain.length && !drawn.length) return [0, 1];
  const usual = drawn.length ? middle(drawn) : [Infinity, -Infinity];
  let [low, high] = usual;
  if (certain.length) {
    const [a, b] = [least(certain), most(certain)];
    const span = Math.max(b - a, 0.04 * Math.max(Math.abs(a), Math.abs(b)), 1e-12);
    low = Math.max(Math.min(a, low), a - 2 * span);
    high = Math.min(Math.max(b, high), b + 2 * span);
  }
  const margin = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

function logRoom(certain, drawn) {
  const all = certain.concat(drawn.length ? middle(drawn) : []);
  if (!all.length) return [0.1, 1];
  const [low, high] = [least(all), most(all)];
  const margin = Math.max((high / low) ** 0.06, 1.05);
  return [low / margin, high * margin];
}

const least = (values) => values.reduce((a, b) => Math.min(a, b), Infinity);
const most = (values) => values.reduce((a, b) => Math.max(a, b), -Infinity);

/** The whole range of x of a chart. */
function xRange(chart) {
  const all = [];
  for (const panel of chart.panels)
    for (const line of panel.lines)
      for (const side of [line.x, line.x_low, line.x_high])
        if (side) for (const v of side) if (Number.isFinite(v) && !(chart.x_log && v <= 0)) all.push(v);
  if (!all.length) return [0, 1];
  const [low, high] = [least(all), most(all)];
  const points = chart.panels.some((p) => p.lines.some((l) => l.kind === "points" || l.kind === "both"));
  if (chart.x_log) return [low / (high / low || 2) ** 0.05, high * (high / low || 2) ** 0.05];
  const margin = points || low === high ? 0.04 * (high - low) || 0.5 : 0;
  return [low - margin, high + margin];
}
