// Why the arm moves as it does at a time, in words: the fastest joint, the one nearest to a limit,
// and what would stop the arm if its self-motion stayed as it is then.

// Angles and lengths as they are said.
function spoken(value, unit) {
  return unit === "m" ? `${(1e3 * value).toFixed(0)} mm` : `${((180 / Math.PI) * value).toFixed(1)}°`;
}

function whyThen({ content: { joints }, plan, maps }, time) {
  const rows = between(plan.curves.t, time);
  const [q, qd] = ["q", "qd"].map((name) => rows(plan.curves[name], joints.length));
  const share = (k) => Math.abs(qd[k]) / (joints[k].speed ?? 1);
  const room = (k) => Math.min(q[k] - (joints[k].lower ?? -Infinity), (joints[k].upper ?? Infinity) - q[k]);
  const order = [...joints.keys()], fast = order.reduce((a, b) => (share(b) > share(a) ? b : a));
  const near = order.reduce((a, b) => (room(b) < room(a) ? b : a));
  const of = joints[fast].speed === null ? "" : `, ${(100 * share(fast)).toFixed(0)} % of its limit`;
  const moves = share(fast) < 1e-3 ? "no joint moves"
    : `${joints[fast].name} moves fastest (${spoken(Math.abs(qd[fast]), joints[fast].unit)}/s${of})`;
  const limit = Number.isFinite(room(near)) ? `, ${joints[near].name} is nearest to a limit (${spoken(room(near), joints[near].unit)})` : "";
  return `${moves}${limit}. ${plan.redundancy.length ? maps.why(time) : ""}`;
}

// The same of a map: the room above and below the plan's line then, and until when it could stay where it is.
function whyOnMap({ t, values, line, label, unit, state, allowed, cause, causes }, time) {
  const i = Math.round((time / t[t.length - 1]) * (t.length - 1)), value = line[i], count = values.length;
  if (!Number.isFinite(value)) return "";
  const degrees = (number) => `${number.toFixed(1)} ${unit}`.replace(" °", "°");
  const row = Math.round(((value - values[0]) / (values[count - 1] - values[0])) * (count - 1));
  // What is not allowed first on a way of pixels, and where; the pixel of the line is the plan's own.
  const stop = (length, pixel, place) => {
    const n = Array.from({ length }, (_, k) => k + 1).find((k) => state[pixel(k)] !== allowed);
    return n && `${place(n)} (${(causes[cause[pixel(n)]] ?? "no configuration").replace(/^joint '(.*?)'/, "$1")})`;
  };
  const column = (way) => stop(way > 0 ? count - 1 - row : row, (n) => i * count + row + way * n, (n) => degrees(values[row + way * n]));
  const along = (way) => stop(way > 0 ? t.length - 1 - i : i, (n) => (i + way * n) * count + row, (n) => `${t[i + way * n].toFixed(2)} s`);
  const [up, down, later, sooner] = [column(1), column(-1), along(1), along(-1)];
  const room = [up && `below ${up}`, down && `above ${down}`].filter(Boolean).join(" and ");
  const never = [sooner && `until ${sooner}`, later && `from ${later}`].filter(Boolean).join(" and ");
  return `What the path leaves free, the ${label}, is ${degrees(value)}${room ? ` then, and has to be ${room}` : ""}. `
    + (never ? `It has to move: ${degrees(value)} is not possible ${never}.` : "That is possible at all times: where it moves, that costs less.");
}
