// Plots over time as inline SVG: curves, limits, a cursor in step with the scene, values on hover.

const SVG = "http://www.w3.org/2000/svg";
const HEIGHT = 190;
const MARGIN = { left: 52, right: 10, top: 10, bottom: 22 };

function element(parent, name, attributes = {}, text = "") {
  const child = parent.namespaceURI === SVG || name === "svg"
    ? document.createElementNS(SVG, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) child.setAttribute(key, value);
  if (text) child.textContent = text;
  parent.append(child);
  return child;
}

function format(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(1);
  return value.toFixed(size >= 100 ? 1 : size >= 10 ? 2 : 3);
}

// Round places between low and high, some `count` of them: 1, 2 or 5 times a power of ten.
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = decade * [1, 2, 5, 10].find((factor) => factor * decade >= rough);
  const places = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) places.push(k * step);
  return places;
}

// A figure that draws itself again where its size changes, until it is removed.
class Figure {
  drawAtEachSize() {
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(this.figure);
    this.draw();
  }

  remove() {
    this.observer.disconnect();
    this.figure.remove();
  }
}

// spec: { title, unit, note, t, log, floor, events: [{ t, name, color }], curves: [{ name, values, color, start, low, high }] }
class Plot extends Figure {
  constructor(parent, spec, onSeek) {
    super();
    Object.assign(this, spec);
    this.time = 0;
    this.chosen = null;
    this.figure = element(parent, "figure", { class: "plot" });
    const caption = element(this.figure, "figcaption");
    element(caption, "span", {}, `${this.title}${this.unit ? ` [${this.unit}]` : ""}`);
    this.at = element(caption, "span", { class: "at" });
    this.svg = element(this.figure, "svg", { role: "img", "aria-label": `${this.title} over time` });
    this.key = element(this.figure, "div", { class: "key" });
    this.makeKey();
    this.svg.addEventListener("pointermove", (event) => {
      this.hover = this.timeAt(event);
      if (event.buttons & 1) onSeek(this.hover);
      this.update();
    });
    this.svg.addEventListener("pointerdown", (event) => onSeek(this.timeAt(event)));
    this.svg.addEventListener("pointerleave", () => { this.hover = undefined; this.update(); });
    this.drawAtEachSize();
  }

  // One entry per curve with its value; where curves have limits, a button that singles one out.
  makeKey() {
    for (const curve of this.curves) {
      const limited = curve.low !== undefined;
      const entry = element(this.key, limited ? "button" : "span", limited
        ? { type: "button", "aria-pressed": "false", title: `Show ${curve.name} alone, with its limits` }
        : { class: "entry" });
      const swatch = element(entry, "i", { class: curve.start ? "start" : "" });
      swatch.style.borderTopColor = curve.color;
      element(entry, "span", {}, curve.name);
      curve.output = element(entry, "output");
      if (!limited) continue;
      entry.addEventListener("click", () => {
        this.chosen = this.chosen === curve ? null : curve;
        for (const button of this.key.children) button.setAttribute("aria-pressed", "false");
        entry.setAttribute("aria-pressed", String(this.chosen === curve));
        this.draw();
      });
    }
  }

  scaled(value) {
    return this.log ? Math.log10(Math.max(value, this.floor)) : value;
  }

  // Limits count for the range only when their curve is singled out: they would flatten the others.
  range() {
    let low = Infinity, high = -Infinity;
    const include = (value) => {
      if (!Number.isFinite(value)) return;
      low = Math.min(low, value);
      high = Math.max(high, value);
    };
    for (const curve of this.chosen ? [this.chosen] : this.curves) {
      for (const value of curve.values) include(this.scaled(value));
      if (this.chosen || this.limits) [curve.low, curve.high].forEach((v) => include(v ?? NaN));
    }
    if (this.zero) include(0);
    if (!(high > low)) [low, high] = [low - 0.5, low + 0.5];
    if (this.log) return [Math.floor(low), Math.max(Math.ceil(high), Math.floor(low) + 1)];
    const room = 0.06 * (high - low);
    return [low - (this.zero && low === 0 ? 0 : room), high + room];
  }

  draw() {
    const width = Math.max(this.svg.clientWidth, 200);
    this.svg.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    this.svg.replaceChildren();
    const [low, high] = this.range();
    const end = this.t[this.t.length - 1];
    const { left, right, top, bottom } = MARGIN;
    this.noise = this.log ? 0 : 1e-7 * (high - low);
    this.x = (time) => left + (time / end) * (width - left - right);
    this.y = (value) => top + ((high - value) / (high - low)) * (HEIGHT - top - bottom);
    this.inverse = (x) => Math.min(Math.max((x - left) / (width - left - right), 0), 1) * end;
    this.drawAxes(low, high, end, width);
    const clip = element(element(this.svg, "clipPath", { id: `clip-${this.id}` }), "rect", {
      x: left, y: top, width: width - left - right, height: HEIGHT - top - bottom });
    const group = element(this.svg, "g", { "clip-path": `url(#${clip.parentNode.id})` });
    for (const { t, name, color } of this.events ?? []) {
      const line = element(group, "line", {
        class: "event", x1: this.x(t), x2: this.x(t), y1: top, y2: HEIGHT - bottom, stroke: color });
      element(line, "title", {}, name);
    }
    for (const curve of this.curves) this.drawCurve(group, curve, left, width - right);
    this.hoverLine = element(this.svg, "line", { class: "hover", y1: top, y2: HEIGHT - bottom });
    this.cursor = element(this.svg, "line", { class: "cursor", y1: top, y2: HEIGHT - bottom });
    this.update();
  }

  drawAxes(low, high, end, width) {
    const { left, right, bottom } = MARGIN;
    const places = this.log
      ? ticks(low, high, 5).filter(Number.isInteger) : ticks(low, high, 5);
    const digits = Math.max(0, -Math.floor(Math.log10((places[1] ?? 1) - (places[0] ?? 0)) + 1e-9));
    for (const place of places) {
      const y = this.y(place);
      element(this.svg, "line", { class: "grid", x1: left, x2: width - right, y1: y, y2: y });
      const label = this.log ? `1e${place}` : place.toFixed(digits).replace(/^-(0(\.0+)?)$/, "$1");
      element(this.svg, "text", { x: left - 6, y: y + 4, "text-anchor": "end" }, label);
    }
    for (const time of ticks(0, end, Math.max(3, width / 110))) {
      element(this.svg, "text", { x: this.x(time), y: HEIGHT - bottom + 15, "text-anchor": "middle" },
        `${Number(time.toPrecision(6))} s`);
    }
  }

  drawCurve(group, curve, from, to) {
    const beyond = this.chosen && this.chosen !== curve ? " beyond" : "";
    let path = "";
    curve.values.forEach((value, k) => {
      path += `${k ? "L" : "M"}${this.x(this.t[k]).toFixed(1)},${this.y(this.scaled(value)).toFixed(1)}`;
    });
    const look = `curve${curve.start ? " start" : ""}${beyond}`;
    element(group, "path", { class: look, d: path, stroke: curve.color });
    for (const limit of [curve.low, curve.high]) {
      if (!Number.isFinite(limit ?? NaN)) continue;
      const y = this.y(limit);
      element(group, "line", { class: `limit${beyond}`, x1: from, x2: to, y1: y, y2: y, stroke: curve.color });
    }
  }

  timeAt(event) {
    const box = this.svg.getBoundingClientRect();
    return this.inverse(event.clientX - box.left);
  }

  seek(time) {
    this.time = time;
    this.update();
  }

  update() {
    const time = this.hover ?? this.time;
    this.move(this.cursor, this.time);
    this.move(this.hoverLine, this.hover ?? this.time);
    this.figure.classList.toggle("hovered", this.hover !== undefined);
    this.at.textContent = this.hover === undefined ? this.note ?? "" : `at ${this.hover.toFixed(2)} s`;
    const end = this.t[this.t.length - 1];
    const place = Math.min(Math.max(time / end, 0), 1) * (this.t.length - 1);
    const k = Math.min(Math.floor(place), this.t.length - 2);
    for (const curve of this.curves) {
      const [a, b] = [curve.values[k], curve.values[k + 1]];
      const value = a + (place - k) * (b - a);
      // Rounding noise about zero is zero, except where noise is what the plot is about.
      curve.output.textContent = format(Math.abs(value) < this.noise ? 0 : value);
    }
  }

  move(line, time) {
    const x = this.x(time);
    line.setAttribute("x1", x);
    line.setAttribute("x2", x);
  }
}

// Column k of a table stored row by row.
function column(table, k, width) {
  return Float32Array.from({ length: table.length / width }, (_, row) => table[row * width + k]);
}

function plotSpecs({ joints }, { curves, start, clearance, steps }) {
  const unit = [...new Set(joints.map((joint) => joint.unit))].join(" or ");
  const perJoint = (table, low, high) => joints.map((joint, k) => ({
    name: joint.name, values: column(table, k, joints.length), color: COLORS[k % COLORS.length],
    low: low(joint) ?? NaN, high: high(joint) ?? NaN }));
  const both = (name) => [
    { name: "plan", values: curves[name], color: COLORS[0] },
    ...(steps.length ? [] : [{ name: "minimum-norm", values: start[name], color: COLORS[1], start: true }])];
  const errors = [
    ...("position" in curves ? [{ name: "position [m]", values: curves.position, color: COLORS[0] }] : []),
    ...("rotation" in curves ? [{ name: "rotation [rad]", values: curves.rotation, color: COLORS[3] }] : [])];
  const { t } = curves;
  const note = "dashed: limits";
  const within = (title, unit, table, limit) => ({ title, unit, t, note,
    curves: perJoint(table, (j) => (j[limit] === null ? null : -j[limit]), (j) => j[limit]) });
  const per = (power) => unit.replaceAll(/rad|m/g, `$&/s${power}`);
  return [
    { title: "Joint positions q", unit, t, note, curves: perJoint(curves.q, (j) => j.lower, (j) => j.upper) },
    within("Joint velocities q̇", per(""), curves.qd, "speed"),
    within("Joint accelerations q̈", per("²"), curves.qdd, "acceleration"),
    ...("torque" in curves ? [within("Joint torques", unit.replaceAll(/rad|m/g, (u) => (u === "m" ? "N" : "Nm")), curves.torque, "effort")] : []),
    { title: "Manipulability √det(JJᵀ)", unit: "", t, zero: true, curves: both("manipulability") },
    // Of several steps each has a path of its own, or none.
    ...(steps.length ? [] : [{ title: curves.relaxed ? "Off the path" : "Path error", unit: "", t, log: true,
      floor: 1e-16, note: curves.relaxed ? "relaxed rows included" : "", curves: errors }]),
    ...(clearance ? [{ title: "Clearance", unit: "m", t: clearance.t, zero: true,
      curves: [{ name: "closest pair", values: clearance.value, color: COLORS[0] }] }] : []),
  ];
}
