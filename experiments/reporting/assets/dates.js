// Dates on the axis of x: of a chart with `x_from`, x counts days from there.

const MILLISECONDS = 86400000; // of a day
const MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
const HOURS = [1, 3, 6, 12, 24, 48, 168, 336];

const origin = (chart) => Date.parse(chart.x_from + (chart.x_from.includes("T") ? "Z" : "T00:00Z"));
const dateAt = (chart, days) => new Date(origin(chart) + days * MILLISECONDS);

/** A value of x in words: a number, or when it was. */
function sayX(chart, value) {
  if (!chart.x_from) return digits(value);
  const text = dateAt(chart, value).toISOString();
  return text.slice(11, 16) === "00:00" ? text.slice(0, 10) : text.slice(0, 16).replace("T", " ");
}

/** Give a scale ticks at round hours, days, months or years. */
function datedTicks(chart, x) {
  const room = Math.max(2, (x.end - x.begin) / 95);
  const span = (x.high - x.low) * 24;
  const step = HOURS.find((hours) => span / hours <= room);
  const times = step ? everyHours(chart, x, step) : everyMonths(chart, x, room);
  return times.map((time, i) => ({ value: (time - origin(chart)) / MILLISECONDS, text: tickText(new Date(time), i === 0, step) }));
}

function everyHours(chart, x, step) {
  const wide = step * 3600000;
  const found = [];
  const [from, to] = [x.low, x.high].map((days) => dateAt(chart, days).getTime());
  for (let time = Math.ceil(from / wide) * wide; time <= to; time += wide) found.push(time);
  return found;
}

function everyMonths(chart, x, room) {
  const [from, to] = [x.low, x.high].map((days) => dateAt(chart, days));
  const count = 12 * (to.getUTCFullYear() - from.getUTCFullYear()) + to.getUTCMonth() - from.getUTCMonth();
  const step = [1, 2, 3, 6, 12, 24, 60, 120].find((months) => count / months <= room) ?? 120;
  const first = 12 * from.getUTCFullYear() + from.getUTCMonth();
  const found = [];
  for (let month = Math.ceil(first / step) * step; month <= first + count; month += step) {
    const time = Date.UTC(Math.floor(month / 12), month % 12);
    if (time >= from.getTime()) found.push(time);
  }
  return found;
}

/** The first tick, and each beginning of a year, say the year; of hours the first says the day. */
function tickText(date, first, hours) {
  const day = `${date.getUTCDate()} ${MONTHS[date.getUTCMonth()]}`;
  const hour = date.toISOString().slice(11, 16);
  if (hours < 24 && date.getUTCHours()) return first ? `${day} ${hour}` : hour;
  const opens = first || (date.getUTCMonth() === 0 && date.getUTCDate() <= (hours ?? 24) / 24);
  return opens ? `${day} ${date.getUTCFullYear()}` : day;
}
