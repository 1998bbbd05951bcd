// The page: one time, which the animator holds; buttons, keys and plots that set or follow it.

const COLORS = ["#4269d0", "#e8871e", "#3ca951", "#e0508c", "#a463f2", "#12a5a5", "#9c6b4e", "#8a94a3"];
const PLAY = "M7 4.5v15l12-7.5z";
const PAUSE = "M6.5 4.5h4v15h-4zm7 0h4v15h-4z";

// Times this near [s] are the same.
const MOMENT = 1e-6;

const get = (id) => document.getElementById(id);

class Page {
  constructor(content, stage) {
    this.content = content;
    this.stage = stage;
    this.layers = Object.fromEntries(content.layers.map(({ name, on }) => [name, on]));
    this.now = 0;
    this.playing = false;
    this.aside = 0;
    this.plots = [];
    this.marks = [];
    this.makeChoice();
    this.makeLegend();
    this.makeLayers();
    this.makeTable();
    this.connect();
    this.jog = new Jog(this);
    get("jog").hidden = get("measure").hidden = !stage;
    if (stage) this.measure = new Measure(stage);
    stage?.onRender((time) => this.follow(time));
    const asked = new URLSearchParams(location.hash.slice(1));
    const plan = Number(asked.get("plan") ?? 1) - 1;
    this.choose(this.content.plans[plan] ? plan : 0);
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (asked.has("t")) this.seek(Number(asked.get("t")) || 0);
    else if (stage && !still && !content.live) this.play();
    if (content.live) this.live = new Live(this);
  }

  // The stages that are shown, each with the number of its plan.
  get sides() {
    if (!this.stage) return [];
    const next = (this.number + 1) % this.content.plans.length;
    return [[this.stage, this.number], ...(this.other ? [[this.other, next]] : [])];
  }

  get duration() { return this.plan.duration; }

  // Show another plan in place of the first; what of it takes long to draw may come later.
  replace({ number, brief, plans: [plan], scale, table, ellipsoidSize, tree, arm, joints, stopped = [] }) {
    Object.assign(this.content, { plans: [plan], scale, ellipsoidSize, joints }, tree ? { tree } : {});
    if (this.stage) {
      if (arm) this.stage.redraw(arm);
      this.stage.replace(plan);
      for (const command of stopped) this.stage.viewer.run(command, this.stage.meshes);
    }
    if (!brief) {
      this.content.table = table;
      this.makeTable();
      this.makeLegend();
    }
    // What is told later of the same plan leaves the arm where it was put by hand.
    const stood = this.standing && number === this.told ? this.stood : null;
    this.told = number;
    this.choose(0, brief);
    if (stood) this.stand(...stood);
  }

  choose(number, brief = false) {
    this.plan = this.content.plans[number];
    this.number = number;
    get("time").max = this.duration;
    // The verdict stands above the scene: not twice.
    get("description").textContent = this.plan.description.replace(this.plan.verdict, "").trim();
    get("verdict").textContent = this.plan.verdict;
    get("verdict").classList.toggle("verified", this.plan.verified);
    [...get("choice").children].slice(0, this.content.plans.length).forEach(
      (button, k) => button.setAttribute("aria-pressed", k === number));
    for (const cell of document.querySelectorAll("[data-plan]")) {
      cell.classList.toggle("shown", this.content.plans.length > 1 && Number(cell.dataset.plan) === number);
    }
    for (const [stage, k] of this.sides) this.loadTo(stage, k);
    get("aside").value = this.aside = 0;
    this.standing = null;
    const { selfMotion } = this.plan;
    get("selfmotion").hidden = !this.stage || !selfMotion;
    if (selfMotion) {
      const far = (selfMotion.steps - 1) / 2;
      Object.assign(get("aside"), { min: -far, max: far });
      get("selfmotion").title = `Moves the arm where it stops, while its tool stays: turns ${selfMotion.joint}`;
    }
    this.applyLayers();
    if (!brief) {
      this.makePlots();
      this.makeSteps();
      this.makeMarks();
    }
    this.seek(Math.min(this.now, this.duration));
  }

  // Time

  seek(time) {
    this.now = Math.min(Math.max(time, 0), this.duration);
    get("aside").value = this.aside = 0;
    this.standing = null;
    // A shorter plan waits at its end for a longer one beside it.
    for (const [stage, k] of this.sides) stage.seek(Math.min(this.now, this.content.plans[k].duration));
    this.follow(this.now);
    if (!this.playing) this.link();
  }

  // The address leads to the time and the plan that are shown.
  link() {
    if (this.content.live || (!location.protocol.startsWith("http") && location.protocol !== "file:")) return;
    const plan = this.content.plans.length > 1 ? `&plan=${this.number + 1}` : "";
    history.replaceState(null, "", `#t=${this.now.toFixed(3)}${plan}`);
  }

  loadTo(stage, k) {
    const plan = this.content.plans[k];
    stage.load(plan);
    stage.element.dataset.label = this.other ? plan.label : "";
  }

  follow(time) {
    this.now = time;
    get("time").value = time;
    const here = this.marks.filter(({ t }) => Math.abs(t - time) < MOMENT).map(({ name }) => `, ${name}`);
    get("time").setAttribute("aria-valuetext", `${time.toFixed(2)} seconds${here.join("")}`);
    get("clock").textContent = `${time.toFixed(2)} / ${this.duration.toFixed(2)} s`;
    for (const plot of this.plots) plot.seek(time);
    this.showPair(time);
    this.showStep(time);
    this.showLast(time);
    get("why").textContent = `At ${time.toFixed(2)} s: ${whyThen(this, time)}`;
    if (!this.standing) this.jog?.show();
    for (const [stage, k] of this.sides) this.showOn(stage, this.content.plans[k], time);
  }

  // What follows the tool and the links.
  showOn(stage, plan, time) {
    if (this.layers.ellipsoid) stage.stretch(plan.ellipsoid, time, this.content.ellipsoidSize);
    if (this.aside && plan.selfMotion) stage.place(plan, time, this.aside + (plan.selfMotion.steps - 1) / 2);
    if (this.standing && plan === this.plan) stage.stand(plan, this.standing);
    stage.accompany(get("follow").checked ? stage.toolAt(plan.ellipsoid, time) : undefined);
    stage.label(this.layers.names ? { ...this.content.links, ...plan.obstacles } : {});
  }

  // The closest pair at the sample nearest in time: by name, and tinted in the scene.
  showPair(time) {
    const { clearance } = this.plan;
    // Where it stands aside the map says what stops it.
    if (this.standing) return;
    const shown = clearance !== null && this.layers.pair && !this.aside;
    get("pair").hidden = !shown;
    if (!shown) {
      this.stage?.mark([], {});
      this.stage?.connect();
      return;
    }
    const last = clearance.t.length - 1;
    const k = Math.round((time / clearance.t[last]) * last);
    const [first, second] = clearance.pairs[k];
    const apart = clearance.value[k];
    get("pair").classList.toggle("meet", apart <= 0);
    get("pair").textContent = apart > 0 ? `closest: ${first} and ${second}, ${format(1e3 * apart)} mm`
      : `${first} and ${second} meet`;
    // Coloured only where it matters: where they meet, or are nearer than twice what is required of them.
    const near = apart < 2 * clearance.required[k];
    this.stage?.mark(apart <= 0 || near ? [first, second] : [], this.plan.obstacles, apart <= 0);
    const ends = [0, 3].map((from) => Array.from(clearance.points.subarray(6 * k + from, 6 * k + from + 3)));
    this.stage?.connect(ends, `${format(1e3 * apart)} mm`, near || apart <= 0);
  }

  play() {
    this.playing = true;
    this.drawPlay();
    if (this.now >= this.duration) this.seek(0);
    let last = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      const next = this.now + ((now - last) / 1000) * Number(get("speed").value);
      last = now;
      const [begin, end] = this.repeated();
      // Rest a moment at the end, then begin again.
      if (next < end) {
        this.seek(next);
      } else if (this.now < end) {
        this.seek(end);
        last += 700;
        if (get("repeat").value === "no") this.pause();
      } else if (next > end) {
        this.seek(begin);
      }
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.playing = false;
    this.drawPlay();
    this.link();
  }

  // From when to when it plays, again and again: all, or the step in which it is.
  repeated() {
    const step = this.plan.steps.findLast(({ begin }) => begin <= this.now - MOMENT) ?? this.plan.steps[0];
    return get("repeat").value === "step" && step ? [step.begin, Math.min(step.end, this.duration)] : [0, this.duration];
  }

  toggle() {
    if (this.playing) this.pause(); else this.play();
  }

  drawPlay() {
    get("play").setAttribute("aria-label", this.playing ? "Pause" : "Play");
    get("play").querySelector("path").setAttribute("d", this.playing ? PAUSE : PLAY);
  }

  // Controls

  connect() {
    this.drawPlay();
    get("play").addEventListener("click", () => this.toggle());
    get("time").addEventListener("input", (event) => { this.pause(); this.seek(Number(event.target.value)); });
    get("home").addEventListener("click", () => this.look(""));
    get("camera").addEventListener("change", () => this.look(get("camera").value));
    get("follow").addEventListener("change", () => this.follow(this.now));
    get("before").addEventListener("click", () => this.jump(-1));
    get("after").addEventListener("click", () => this.jump(1));
    get("aside").addEventListener("input", () => this.turn(Number(get("aside").value)));
    get("download").addEventListener("click", () => this.download());
    document.addEventListener("keydown", (event) => this.key(event));
    const letters = this.content.layers.map(({ key, label }) => [key, label]);
    get("morekeys").replaceChildren(...letters.flatMap(([key, label]) => {
      const kbd = document.createElement("kbd");
      kbd.textContent = key;
      return [" · ", kbd, ` ${label}`];
    }));
  }

  look(direction) {
    get("camera").value = direction;
    for (const [stage] of this.sides) stage.frame(direction ? unit(direction.split(",").map(Number)) : undefined);
  }

  // Move the arm along its self-motion, where it stands.
  turn(step) {
    if (this.playing) this.pause();
    this.aside = step;
    this.standing = null;
    // Of these postures nobody has measured it.
    get("pair").hidden = true;
    this.stage?.mark([], {});
    this.stage?.connect();
    for (const [stage, k] of this.sides) {
      const { selfMotion } = this.content.plans[k];
      if (selfMotion) stage.place(this.content.plans[k], this.now, step + (selfMotion.steps - 1) / 2);
      stage.label(this.layers.names ? { ...this.content.links, ...this.content.plans[k].obstacles } : {});
    }
  }

  // Stand in a configuration that the map has, with the bodies marked that meet there.
  stand(q, cause, said = `shown from the map: ${cause || "allowed"}`) {
    this.standing = q;
    this.stood = [q, cause, said];
    // In the place of the closest pair: the map stays where it is under the pointer.
    get("pair").hidden = false;
    get("pair").textContent = said;
    get("pair").classList.toggle("meet", cause !== "");
    this.stage?.mark(cause.split(" "), this.plan.obstacles, true);
    this.stage?.connect();
    for (const [stage, k] of this.sides) this.showOn(stage, this.content.plans[k], this.now);
  }

  // Two plans side by side, on one clock and seen from one place.
  setBeside(on) {
    get("beside").hidden = !on;
    get("views").classList.toggle("two", on);
    if (on && !this.second) {
      this.second = new Stage(get("beside"), this.content);
      const [one, other] = [this.stage, this.second].map((stage) => stage.viewer);
      for (const [from, to] of [[one, other], [other, one]]) {
        from.controls.addEventListener("change", () => {
          to.camera.position.copy(from.camera.position);
          to.camera.quaternion.copy(from.camera.quaternion);
          to.controls.target.copy(from.controls.target);
          to.draw();
        });
      }
    }
    this.other = on ? this.second : undefined;
    get("sides").setAttribute("aria-pressed", on);
    this.choose(this.number);
    for (const [stage] of this.sides) stage.resize();
    this.look(get("camera").value);
  }

  // A table of the motion as it is shown: times and joint positions.
  download() {
    const { t, q } = this.plan.curves, { joints } = this.content;
    const lines = Array.from(t, (time, row) =>
      [time, ...q.subarray(row * joints.length, (row + 1) * joints.length)].join(","));
    const text = [["t", ...joints.map(({ name }) => name)].join(","), ...lines, ""].join("\n");
    offer(new Blob([text], { type: "text/csv" }), "motion.csv");
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select")) return;
    if (event.key === " " && event.target.closest("button, input[type=checkbox]")) return;
    const step = this.duration * (event.shiftKey ? 0.1 : 0.01);
    const layer = this.content.layers.find(({ key }) => key === event.key);
    const actions = {
      " ": () => this.toggle(),
      ArrowLeft: () => { this.pause(); this.seek(this.now - step); },
      ArrowRight: () => { this.pause(); this.seek(this.now + step); },
      Home: () => { this.pause(); this.seek(0); },
      End: () => { this.pause(); this.seek(this.duration); },
      r: () => this.look(""),
      v: () => { get("follow").checked = !get("follow").checked; this.follow(this.now); },
      ",": () => this.jump(-1),
      ".": () => this.jump(1),
    };
    const number = Number(event.key) - 1;
    if (layer) this.setLayer(layer.name, !this.layers[layer.name]);
    else if (this.content.plans[number] && this.content.plans.length > 1) this.choose(number);
    else if (event.key in actions) actions[event.key]();
    else return;
    event.preventDefault();
  }

  makeChoice() {
    get("choice").hidden = this.content.plans.length < 2;
    this.content.plans.forEach((plan, k) => {
      const button = element(get("choice"), "button", { type: "button", title: `Key ${k + 1}` }, plan.label);
      button.addEventListener("click", () => this.choose(k));
    });
    if (this.content.plans.length < 2 || !this.stage) return;
    const both = element(get("choice"), "button", {
      type: "button", id: "sides", "aria-pressed": false, title: "Two plans on one clock" }, "side by side");
    both.addEventListener("click", () => this.setBeside(!this.other));
  }

  makeLegend() {
    const { low, high, colors } = this.content.scale;
    // Of several steps traces have the colours of their seams.
    get("legend").hidden = !this.stage || this.content.plans[0].steps.length > 0;
    get("scale").style.background = `linear-gradient(to right, ${colors.join(", ")})`;
    const [from, to] = get("range").children;
    from.textContent = format(low);
    to.textContent = format(high);
  }

  makeLayers() {
    get("layers").hidden = !this.stage;
    for (const { name, label, key } of this.content.layers) {
      const line = element(get("layers"), "label", { title: `Key ${key}` });
      const box = element(line, "input", { type: "checkbox", id: `layer-${name}` });
      line.append(label);
      box.checked = this.layers[name];
      box.addEventListener("change", () => this.setLayer(name, box.checked));
    }
  }

  setLayer(name, visible) {
    this.layers[name] = visible;
    get(`layer-${name}`).checked = visible;
    this.applyLayers();
  }

  applyLayers() {
    this.showPair(this.now);
    for (const [stage, number] of this.sides) this.applyLayersTo(stage, number);
    for (const [stage, k] of this.sides) this.showOn(stage, this.content.plans[k], this.now);
  }

  applyLayersTo(stage, number) {
    const { ghost = false, trace, triads, ellipsoid, bodies = false, frames } = this.layers;
    stage.show("/selfmotion/ghost", ghost);
    stage.show("/selfmotion/ellipsoid", ellipsoid);
    stage.show("/selfmotion/bodies", bodies);
    for (const axes of stage.axes) axes.visible = frames;
    this.content.plans.forEach((plan, k) => {
      const shown = k === number;
      stage.show(`${plan.root}/obstacles`, shown);
      for (const { root } of plan.tips) {
        stage.show(`${root}/prescribed`, shown && trace);
        stage.show(`${root}/trace`, shown && trace);
        stage.show(`${root}/start`, shown && trace && ghost);
        stage.show(`${root}/triads`, shown && triads);
      }
    });
  }

  // Plots and table

  makePlots() {
    const seek = (time) => { this.pause(); this.seek(time); };
    const { redundancy, events } = this.plan;
    // A page that plans has its maps beside the scene, and the older ones until others are there.
    const home = this.content.live ? get("maps") : get("plots");
    const older = this.content.live && this.plan.verified && !redundancy.length ? this.maps : undefined;
    for (const plot of this.plots) if (plot !== older) plot.remove();
    get("maps").classList.toggle("stale", older !== undefined);
    this.maps = older ?? (redundancy.length ? new Maps(home, redundancy, seek, (q, cause) => this.stand(q, cause)) : undefined);
    this.plots = [...(this.maps ? [this.maps] : []),
      ...plotSpecs(this.content, this.plan).map((spec, id) => new Plot(get("plots"), { ...spec, id, events }, seek))];
  }

  // What a program consists of: a button for each step, which leads to its begin.
  makeSteps() {
    get("steps").hidden = this.plan.steps.length < 2;
    get("steps").replaceChildren();
    this.steps = this.plan.steps.map(({ begin, end, name, color }) => {
      const title = `from ${begin.toFixed(2)} to ${end.toFixed(2)} s`;
      const button = element(get("steps"), "button", { type: "button", title, class: color ? "seam" : "move" }, name);
      if (color) button.style.borderLeftColor = color;
      element(button, "small", {}, `${begin.toFixed(1)} s`);
      button.addEventListener("click", () => { this.pause(); this.seek(begin); });
      return button;
    });
  }

  showStep(time) {
    const { steps } = this.plan;
    // At the end of one the next one has begun.
    const now = steps.findLastIndex(({ begin }) => begin <= time + MOMENT);
    this.steps?.forEach((button, k) => button.setAttribute("aria-current", k === now ? "step" : "false"));
  }

  // Below the slider: seams as long as they last, events as ticks. Keys lead to them as well, so
  // that a job of hundreds has not as many stops of the tabulator once more.
  makeMarks() {
    const seams = this.plan.steps.filter(({ color }) => color).map((step) => ({ ...step, t: step.begin }));
    this.marks = [...seams, ...this.plan.events];
    get("marks").hidden = get("markkeys").hidden = get("leaps").hidden = this.marks.length === 0;
    get("repeat").querySelector("[value=step]").hidden = this.plan.steps.length < 2;
    get("last").hidden = this.plan.events.length === 0;
    get("marks").replaceChildren();
    for (const { t, end, name, color } of this.marks) {
      const title = `${name}, at ${t.toFixed(2)} s`;
      const button = element(get("marks"), "button", {
        type: "button", tabindex: -1, title, "aria-label": title, class: end === undefined ? "event" : "seam" });
      button.style.color = color;
      button.style.left = `${(100 * t) / this.duration}%`;
      if (end !== undefined) button.style.width = `${(100 * (end - t)) / this.duration}%`;
      button.addEventListener("click", () => { this.pause(); this.seek(t); });
    }
  }

  // To the next mark, or to the one before.
  jump(way) {
    const there = this.marks.map(({ t }) => t).filter((t) => way * (t - this.now) > MOMENT);
    this.pause();
    if (there.length) this.seek(way > 0 ? Math.min(...there) : Math.max(...there));
  }

  showLast(time) {
    const event = this.plan.events.findLast(({ t }) => t <= time + MOMENT);
    get("last").textContent = event ? `${event.name}, at ${event.t.toFixed(2)} s` : "no event yet";
  }

  makeTable() {
    get("numbers").replaceChildren();
    element(get("numbers"), "h2", {}, "Report and certificate");
    const table = element(element(get("numbers"), "div", { class: "wide" }), "table");
    const head = element(element(table, "thead"), "tr");
    element(head, "td");
    const columns = this.content.columns ?? this.content.plans.map(({ label }) => label);
    columns.forEach((label, k) => element(head, "th", { scope: "col", "data-plan": k }, label));
    const body = element(table, "tbody");
    for (const { label, cells } of this.content.table) {
      const row = element(body, "tr");
      element(row, "th", { scope: "row" }, label);
      cells.forEach(([value, note], k) => {
        const cell = element(row, "td", { "data-plan": k }, value);
        if (note) {
          cell.append(" ");
          element(cell, "small", {}, note);
        }
      });
    }
  }
}

function unit(vector) {
  const length = Math.hypot(...vector);
  return vector.map((value) => value / length);
}

async function start() {
  const content = await readPayload(get("payload").textContent);
  let stage = null;
  try {
    const code = new TextDecoder().decode(await inflate(get("viewer").textContent));
    // Its hash is in the page's Content-Security-Policy: nothing else can be run this way.
    element(document.head, "script", {}, code);
    stage = new Stage(get("view"), content);
    get("notice").hidden = true;
    document.documentElement.classList.add("moving");
  } catch (error) {
    const reason = error.message.replace(/\.+$/, "");
    get("notice").textContent = `No 3-D view: ${reason}. The plots and numbers are complete.`;
    get("notice").classList.add("below");
    get("view").hidden = true;
    console.warn(error);
  }
  window.viewer = stage?.viewer;
  window.replay = new Page(content, stage);
  document.documentElement.dataset.replay = "ready";
}

start().catch((error) => {
  get("notice").textContent = `This browser cannot unpack the replay: ${error.message}`;
  throw error;
});
