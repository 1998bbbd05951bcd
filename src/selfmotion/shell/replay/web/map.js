// The redundancy map: time against the self-motion's coordinate, what stops the arm where, the
// plan's line through it. Pointing tells what is there; a click lets the arm stand there.

const MAP_HEIGHT = 300;
const NO_CAUSE = 0xffff;

function rgb(color) {
  return [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
}

// A colour between several ones, evenly spaced: share from 0 to 1.
function shade(colors, share) {
  const place = share * (colors.length - 1);
  const k = Math.min(Math.floor(place), colors.length - 2);
  return colors[k].map((value, i) => value + (place - k) * (colors[k + 1][i] - value));
}

// The maps of a plan, or of a job's seams, with their slices: one of them is shown at a time.
class Maps {
  constructor(parent, seams, onSeek, onStand) {
    Object.assign(this, { parent, seams, onSeek, onStand });
    this.show(seams[0]);
  }

  show(seam) {
    this.map?.remove();
    this.seam = seam;
    const { begin, name, slices } = seam;
    // The slice that was chosen stays the one that is shown, in other plans and seams, too.
    const slice = slices.find(({ label }) => label === Maps.chosen) ?? slices[0];
    this.map = new RedundancyMap(this.parent, { ...slice, name, choices: slices.length }, (time) => this.onSeek(begin + time), this.onStand);
    if (slices.length < 2) return;
    const choice = element(this.map.caption, "select", { "aria-label": "Slice along" });
    for (const { label } of slices) element(choice, "option", label === slice.label ? { selected: "" } : {}, label);
    choice.addEventListener("change", () => {
      Maps.chosen = choice.value;
      this.show(seam);
      this.seek(this.time);
    });
  }

  seek(time) {
    this.time = time;
    const seam = this.seams.findLast(({ begin }) => begin <= time + 1e-6) ?? this.seams[0];
    if (seam !== this.seam) this.show(seam);
    this.map.seek(Math.max(time - seam.begin, 0));
  }

  // What the map of the seam says of a time; of a move between seams nothing.
  why(time) {
    const { begin, slices } = this.seam, within = time - begin;
    return within >= 0 && within <= slices[0].t.at(-1) + 1e-6 ? whyOnMap(this.map, within) : "";
  }

  remove() { this.map.remove(); }
}

class RedundancyMap extends Figure {
  constructor(parent, data, onSeek, onStand) {
    super();
    Object.assign(this, data);
    this.onSeek = onSeek;
    this.onStand = onStand;
    this.time = 0;
    this.figure = element(parent, "figure", { class: "map" });
    this.caption = element(this.figure, "figcaption");
    const of = this.name ? ` of ${this.name}` : "";
    const along = this.slice && this.choices > 1 ? "" : `: ${this.label}`;
    element(this.caption, "span", {}, `Redundancy map${of}${along} [${this.unit}]`);
    element(this.caption, "span", { class: "at" }, `${this.slice ? "a slice; " : ""}click: stand there`);
    const frame = this.frame = element(this.figure, "div", { class: "frame" });
    this.canvas = element(frame, "canvas", { width: this.t.length, height: this.values.length });
    this.svg = element(frame, "svg", { role: "img", "aria-label": `What stops the arm, by time and ${this.label}` });
    this.said = element(this.figure, "output", { class: "said" });
    this.key = element(this.figure, "div", { class: "key" });
    this.paint();
    this.makeKey();
    const look = (event) => { this.hover = this.pixel(event); this.tell(); };
    const stand = (event) => { look(event); this.stand(); };
    this.svg.addEventListener("pointermove", (event) => (event.buttons & 1 ? stand : look)(event));
    this.svg.addEventListener("pointerdown", stand);
    this.svg.addEventListener("pointerleave", () => { this.hover = undefined; this.tell(); });
    this.drawAtEachSize();
  }

  // A pixel of the canvas for each of the map, the highest value at the top.
  paint() {
    const [wide, high] = [this.t.length, this.values.length];
    const colors = Object.fromEntries(this.reasons.map(({ code, color }) => [code, rgb(color)]));
    const costs = this.costColors.map(rgb);
    const image = new ImageData(wide, high);
    for (let i = 0; i < wide; i++) {
      for (let j = 0; j < high; j++) {
        const at = i * high + j;
        const color = this.state[at] === this.allowed ? shade(costs, this.excess[at] / 255) : colors[this.state[at]];
        image.data.set([...color, 255], 4 * ((high - 1 - j) * wide + i));
      }
    }
    this.canvas.getContext("2d")?.putImageData(image, 0, 0);
  }

  makeKey() {
    const entry = (name, look) => {
      const item = element(this.key, "span", { class: "entry" });
      Object.assign(element(item, "b").style, look);
      element(item, "span", {}, name);
    };
    entry("plan", { background: "#111", height: "3px" });
    entry("minimum-norm", { background: "repeating-linear-gradient(to right, #111 0 4px, #fff 4px 6px)", height: "2px" });
    const above = this.hasCost ? `, cost up to ${format(this.high)} per s above the least then` : "";
    entry(`allowed${above}`, { background: `linear-gradient(to right, ${this.costColors.join(", ")})`, width: "40px" });
    for (const { name, color } of this.reasons) entry(name, { background: color });
  }

  draw() {
    const width = Math.max(this.svg.clientWidth, 200), height = this.frame.clientHeight || MAP_HEIGHT;
    const { left, right, top, bottom } = MARGIN;
    const wide = width - left - right, high = height - top - bottom;
    const end = this.t[this.t.length - 1], count = this.values.length;
    const low = this.values[0], step = (this.values[count - 1] - low) / (count - 1);
    // Half a pixel beyond the first and the last one, in both directions.
    const lasts = end / (this.t.length - 1);
    this.x = (time) => left + ((time + lasts / 2) / (end + lasts)) * wide;
    this.y = (value) => top + high - ((value - low) / step + 0.5) / count * high;
    this.inverse = (x, y) => [
      Math.floor(((x - left) / wide) * this.t.length), Math.floor(((top + high - y) / high) * count)];
    Object.assign(this.canvas.style, { left: `${left}px`, top: `${top}px`, width: `${wide}px`, height: `${high}px` });
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.replaceChildren();
    for (const place of ticks(low, this.values[count - 1], 8)) {
      element(this.svg, "text", { x: left - 6, y: this.y(place) + 4, "text-anchor": "end" }, String(Number(place.toPrecision(6))));
    }
    for (const time of ticks(0, end, Math.max(3, width / 110))) {
      element(this.svg, "text", { x: this.x(time), y: height - bottom + 15, "text-anchor": "middle" },
        `${Number(time.toPrecision(6))} s`);
    }
    element(element(this.svg, "clipPath", { id: "clip-map" }), "rect", { x: left, y: top, width: wide, height: high });
    const group = element(this.svg, "g", { "clip-path": "url(#clip-map)" });
    for (const [line, look] of [[this.start, "line start"], [this.line, "line"]]) {
      const d = Array.from(line, (value, k) => (Number.isFinite(value)
        ? `${k && Number.isFinite(line[k - 1]) ? "L" : "M"}${this.x(this.t[k]).toFixed(1)},${this.y(value).toFixed(1)}` : "")).join("");
      // On dark colours as on light ones: a white rim below.
      element(group, "path", { class: "rim", d });
      element(group, "path", { class: look, d });
    }
    this.cursor = element(group, "line", { class: "cursor", y1: top, y2: top + high });
    this.mark = element(group, "circle", { class: "mark", r: 5, visibility: "hidden" });
    this.update();
  }

  // The pixel under a pointer; undefined beside the map.
  pixel(event) {
    const box = this.svg.getBoundingClientRect();
    const [i, j] = this.inverse(event.clientX - box.left, event.clientY - box.top);
    return i >= 0 && j >= 0 && i < this.t.length && j < this.values.length ? [i, j] : undefined;
  }

  // What is at a pixel, in words.
  words([i, j]) {
    const at = i * this.values.length + j;
    const place = `${this.t[i].toFixed(2)} s, ${this.values[j].toFixed(1)} ${this.unit}`.replace(" °", "°");
    if (this.state[at] === this.nowhere) return `${place}: no configuration`;
    if (this.cause[at] !== NO_CAUSE) return `${place}: ${this.causes[this.cause[at]]}`;
    if (!this.hasCost) return `${place}: allowed`;
    const above = (this.excess[at] / 255) * this.high;
    // Less than a thousandth is what sums leave, and no price.
    if (above < 1e-3 * this.least[i]) return `${place}: allowed, cost ${format(this.least[i])} per s, the least then`;
    const most = this.capped && this.excess[at] === 255 ? "at least " : "";
    return `${place}: allowed, cost ${format(this.least[i] + above)} per s, ${most}${format(above)} above the least then`;
  }

  tell() {
    const shown = this.hover ?? this.chosen;
    this.said.textContent = shown ? this.words(shown) : "Point at the map to see what stops the arm there.";
  }

  // Configurations are differences upwards on a grid of each joint's range.
  configuration([i, j]) {
    const { first, step, codes } = this.q;
    const [wide, high] = [this.t.length, this.values.length];
    return first.map((least, joint) => {
      let place = 0;
      for (let k = 0; k <= j; k++) place = (place + codes[(joint * wide + i) * high + k]) & 0xffff;
      return least + step[joint] * place;
    });
  }

  stand() {
    if (!this.hover) return;
    const [i, j] = this.hover, at = i * this.values.length + j;
    this.onSeek(this.t[i]);
    this.chosen = this.hover;
    if (this.state[at] !== this.nowhere) {
      this.onStand(this.configuration(this.hover), this.cause[at] === NO_CAUSE ? "" : this.causes[this.cause[at]]);
    }
    this.update();
  }

  seek(time) {
    this.time = time;
    // Where the arm moves on it does not stand there any more.
    if (this.chosen && Math.abs(time - this.t[this.chosen[0]]) > 1e-3) this.chosen = undefined;
    this.update();
  }

  update() {
    for (const end of ["x1", "x2"]) this.cursor.setAttribute(end, this.x(this.time));
    this.mark.setAttribute("visibility", this.chosen ? "visible" : "hidden");
    if (this.chosen) {
      this.mark.setAttribute("cx", this.x(this.t[this.chosen[0]]));
      this.mark.setAttribute("cy", this.y(this.values[this.chosen[1]]));
    }
    this.tell();
  }
}
