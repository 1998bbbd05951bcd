// The page while its problem is changed: what is asked of the server, and what it tells.

const TOLD = ["cost", "seams", "moves", "limits used fully", "margin to joint limits", "speed", "duration"];
// How the server ends a connection: without the token, and where another tab has the page.
const REFUSED = 4403;
const TAKEN = 4409;
// The node of the places in reach.
const FLOOR = "/selfmotion/floor";
// A slider has so many steps.
const STEPS = 400;

class Live {
  constructor(page) {
    this.page = page;
    this.token = new URLSearchParams(location.search).get("token") ?? "";
    this.sliders = new Map();
    // What was asked is counted; what is shown answers one of these.
    this.asked = this.answered = 0;
    const { saves, why, exports } = page.content.live;
    document.documentElement.classList.add("live");
    get("change").hidden = false;
    // What is only looked at has nothing to be changed.
    get("change").classList.toggle("fixed", !saves);
    get("save").title = `Writes ${saves}`;
    for (const [value, name] of exports) element(get("export"), "option", { value }, name);
    if (!saves) this.say(why);
    get("export").parentElement.hidden = exports.length === 0;
    get("second").hidden = page.content.plans[0].steps.length > 0;
    if (page.stage) {
      this.handles = new Handles(page.stage, page.content.radius,
        (name, matrix, final) => this.drag(name, matrix, final), (handle) => this.chose(handle));
    }
    if (page.stage) page.stage.also = () => [...this.handles.shown.values()].map(
      ({ mark }) => mark.getWorldPosition(new THREE.Vector3()).toArray());
    for (const input of this.places) input.addEventListener("change", () => this.put(input));
    get("undo").addEventListener("click", () => this.ask({ do: "undo" }));
    get("save").addEventListener("click", () => this.ask({ do: "save" }));
    get("export").addEventListener("change", () => this.export(get("export").value));
    get("mass").addEventListener("change", () => this.export(".mod"));
    get("second").addEventListener("click", () => (this.beside ? this.compare() : get("secondfile").click()));
    get("secondfile").addEventListener("change", ({ target }) => { if (target.files.length) this.compare(target.files[0]); });
    get("turns").addEventListener("click", () => this.handles?.setTurns(!this.handles.turns) ?? this.drawTurns());
    get("letgo").addEventListener("click", () => this.handles?.choose(undefined));
    window.addEventListener("beforeunload", (event) => { if (this.changed) event.preventDefault(); });
    this.connect();
  }

  // Where what is chosen stands: x, y, z.
  get places() { return [...get("place").querySelectorAll("input")]; }

  connect() {
    this.socket = new WebSocket(`ws://${location.host}/live?token=${encodeURIComponent(this.token)}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.addEventListener("message", ({ data }) => {
      if (typeof data === "string") this.hear(JSON.parse(data));
      else this.take(revivePayload(data));
    });
    this.socket.addEventListener("close", ({ code, reason }) => this.end(code, reason));
  }

  end(code, reason) {
    const said = code === TAKEN ? "Another tab has this page: close it there, then load this one again."
      : code === REFUSED ? `Refused: ${reason}.`
        : "The server has ended. Run selfmotion view again; what was not saved is lost.";
    this.say(said, true);
    this.changed = false;
    get("change").inert = true;
    this.handles?.choose(undefined);
    document.documentElement.dataset.live = code === TAKEN ? "taken" : "ended";
  }

  ask(asked) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.say("");
    // What does not change the document leaves its plan as it is.
    if (asked.do !== "save" && asked.do !== "choose") {
      this.asked += 1;
      this.wait();
    }
    this.socket.send(JSON.stringify({ ...asked, mark: this.asked }));
  }

  say(text, bad = false) {
    get("told").textContent = text;
    get("told").classList.toggle("bad", bad);
  }

  // What is shown is the older plan, until another one comes.
  wait() {
    document.documentElement.dataset.live = "waiting";
    get("verdict").className = "coarse";
    this.page.stage?.setGrey(true);
  }

  // A short answer: what cannot be done, or that it is saved. A plan of what is answers either.
  hear(answer) {
    if (answer.error) return this.say(answer.error, true);
    if (answer.saved) this.say(answer.saved);
    this.state(answer);
  }

  state({ sliders, changed, undo }) {
    this.changed = changed;
    get("save").disabled = !changed;
    get("undo").disabled = !undo;
    this.drawSliders(sliders);
  }

  // A plan, or a first motion, or what stops it.
  take(message) {
    const { page } = this;
    const { kind, brief, plans, handles } = message;
    const coarse = kind === "coarse";
    this.answered = message.answers;
    this.state(message);
    if (plans) {
      this.handles?.settle();
      page.content.columns = message.beside ? ["this one", message.beside] : undefined;
      this.drawBeside(message.beside);
      page.replace(message);
      this.handles?.update(handles);
      this.drawHandles(handles);
      if (coarse) this.handles?.carry();
    }
    this.drawFloor(this.handles?.chosen ? message.floor : undefined);
    if (!coarse) this.drawNumbers(message.table);
    get("plots").classList.toggle("stale", brief);
    if (brief) get("maps").classList.add("stale");
    document.documentElement.dataset.brief = brief;
    this.judge(message);
  }

  // Say what is shown: verified only where it answers what was asked last.
  judge(message) {
    this.last = message;
    const open = message.kind === "coarse" || this.answered !== this.asked;
    const verified = message.plans?.[0].verified && !open;
    get("verdict").textContent = open && message.kind !== "coarse" ? "planning …" : message.words;
    get("verdict").className = open ? "coarse" : verified ? "verified" : "";
    get("state").textContent = open ? "planning …" : verified ? "verified" : "not verified, see above";
    get("figures").classList.toggle("stale", open);
    this.page.stage?.setGrey(!verified);
    // A program in the order before is verified, and not the last word.
    document.documentElement.dataset.live = open ? "coarse" : !verified ? "stopped"
      : message.kind === "early" ? "early" : "verified";
  }

  // Where else what is dragged could stand: green on the ground, seen through what stands on it.
  drawFloor(floor) {
    const { stage, content } = this.page;
    stage?.viewer.remove(FLOOR);
    get("green").hidden = !floor;
    if (!stage || !floor) return;
    const { places, size } = floor, high = content.ground + 0.002 * content.radius;
    const vertices = [], triangles = [];
    for (let k = 0; k < places.length; k += 2) {
      for (const [x, y] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        vertices.push(places[k] + 0.46 * x * size, places[k + 1] + 0.46 * y * size, high);
      }
      triangles.push(...[0, 1, 2, 0, 2, 3].map((corner) => 2 * k + corner));
    }
    const squares = new THREE.Mesh(
      surface({ vertices: new Float32Array(vertices), triangles: new Uint32Array(triangles) }),
      new THREE.MeshBasicMaterial({ color: 0x2ea043, transparent: true, opacity: 0.35, depthTest: false }));
    stage.find(FLOOR).add(Object.assign(squares, { renderOrder: 1 }));
    stage.viewer.draw();
  }

  drawNumbers(table) {
    if (!table) return;
    const rows = table.filter(({ label }) => TOLD.includes(label) || label.startsWith("closest to"));
    get("figures").replaceChildren();
    const columns = this.page.content.columns ?? [""];
    get("figures").style.gridTemplateColumns = `auto${" auto".repeat(columns.length)}`;
    if (columns.length > 1) for (const name of ["", ...columns]) element(get("figures"), "dt", {}, name);
    for (const { label, cells } of rows) {
      element(get("figures"), "dt", {}, label);
      // Where and when is in the table below: here the numbers leave room for the map.
      for (const [value, note] of cells) element(get("figures"), "dd", note ? { title: note } : {}, value);
    }
  }

  // Handles

  drawHandles(handles) {
    const names = handles.map(({ name }) => name);
    const { chosen } = this.handles ?? {};
    if (chosen && !this.handles.gripped) this.drawPlace(chosen.matrix);
    if (String(names) === String(this.named)) return;
    this.named = names;
    get("handles").replaceChildren();
    for (const name of names) {
      const button = element(get("handles"), "button", { type: "button", "data-handle": name, "aria-pressed": false }, name);
      button.addEventListener("click", () => {
        this.handles?.choose(this.handles.name === name ? undefined : name);
        get("scene").scrollIntoView({ block: "nearest" });
      });
    }
    this.chose(this.handles?.chosen);
  }

  chose(handle) {
    if (handle?.name !== this.chosenName) this.ask({ do: "choose", name: handle?.name ?? "" });
    if (!handle) this.drawFloor(undefined);
    this.chosenName = handle?.name;
    get("from").textContent = handle?.node ? "mm from what carries it" : "mm";
    get("place").hidden = !handle?.moves;
    if (handle) this.drawPlace(handle.matrix);
    for (const button of get("handles").children) {
      button.setAttribute("aria-pressed", button.dataset.handle === handle?.name);
    }
    get("turns").hidden = !(handle?.turns && handle.moves);
    get("letgo").hidden = !handle;
    this.drawTurns();
  }

  drawPlace(matrix) {
    this.places.forEach((input, k) => { if (document.activeElement !== input) input.value = (1e3 * matrix[12 + k]).toFixed(1); });
  }

  drag(name, matrix, final) {
    this.drawPlace(matrix);
    this.ask({ do: "drag", name, matrix, final });
  }

  // A place that is typed [mm].
  put(input) {
    const matrix = [...this.handles.chosen.matrix];
    matrix[12 + Number(input.dataset.axis)] = Number(input.value) / 1e3;
    if (input.value !== "") this.drag(this.handles.name, matrix, true);
  }

  drawTurns() {
    get("turns").textContent = this.handles?.turns ? "Move it" : "Turn it";
  }

  // Sliders

  drawSliders(sliders) {
    const names = sliders.map(({ name }) => name);
    if (String(names) !== String([...this.sliders.keys()])) this.makeSliders(sliders);
    for (const slider of sliders) {
      const known = this.sliders.get(slider.name);
      Object.assign(known.slider, slider);
      // What was slid since then is newer than what is told.
      if (this.asked !== this.answered) continue;
      known.input.value = place(slider, slider.value);
      if (document.activeElement !== known.typed) known.typed.value = number(slider.value);
    }
  }

  makeSliders(sliders) {
    get("sliders").replaceChildren();
    this.sliders.clear();
    for (const given of sliders) {
      const slider = { ...given };
      const line = element(get("sliders"), "label", {});
      element(line, "span", {}, slider.name);
      const input = element(line, "input", {
        type: "range", min: 0, max: STEPS, step: 1, "data-slider": slider.name, "aria-label": slider.name });
      // A number that is known is typed.
      const typed = element(line, "input", {
        type: "number", step: "any", min: slider.low, max: slider.high, "data-typed": slider.name, "aria-label": `${slider.name}, as a number` });
      element(line, "span", { class: "unit" }, slider.unit);
      const slide = (value, final) => this.ask({ do: "slide", name: slider.name, value, final });
      const slid = (final) => {
        typed.value = number(at(slider, Number(input.value)));
        slide(at(slider, Number(input.value)), final);
      };
      input.addEventListener("input", () => slid(false));
      input.addEventListener("change", () => slid(true));
      typed.addEventListener("change", () => { if (typed.value !== "") slide(Number(typed.value), true); });
      this.sliders.set(slider.name, { slider, input, typed });
    }
  }

  // Show the plan of a file beside the own one; without a file none.
  async compare(file) {
    const address = `/beside?name=${encodeURIComponent(file?.name ?? "")}&token=${encodeURIComponent(this.token)}`;
    const answer = await fetch(address, { method: "POST", body: file ?? "" });
    get("secondfile").value = "";
    this.say(answer.ok ? "" : await answer.text(), !answer.ok);
  }

  // Another plan takes the place of the minimum-norm motion as the ghost of this one.
  drawBeside(beside) {
    const { page } = this;
    if (beside === (this.beside ?? "")) return;
    this.beside = beside;
    get("second").textContent = beside ? `Without ${beside}` : "Compare …";
    const box = get("layer-ghost");
    if (!box) return;
    box.nextSibling.textContent = beside || page.content.layers.find(({ name }) => name === "ghost").label;
    page.setLayer("ghost", beside !== "");
  }

  async export(suffix) {
    get("export").value = "";
    // Controllers of ABB move by the mass that they carry.
    get("load").hidden = suffix !== ".mod";
    if (!suffix) return;
    this.say(`Writing ${suffix} …`);
    const answer = await fetch(`/export?as=${suffix}&mass=${get("mass").value}&token=${encodeURIComponent(this.token)}`);
    if (!answer.ok) return this.say(await answer.text(), true);
    const name = decodeURIComponent(answer.headers.get("Content-Disposition").split("UTF-8''")[1]);
    offer(await answer.blob(), name);
    this.say(`Exported ${name}.`);
  }
}

// Where on a slider a value is, and the other way round: by even factors, or even differences.
function place({ low, high, even }, value) {
  const share = even ? (value - low) / (high - low) : Math.log(value / low) / Math.log(high / low);
  return Math.round(STEPS * share);
}

function at({ low, high, even }, step) {
  const share = step / STEPS;
  const value = even ? low + share * (high - low) : low * (high / low) ** share;
  // Three digits are as many as a hand can set.
  return Math.min(Math.max(Number(value.toPrecision(3)), low), high);
}

function number(value) {
  return String(Number(value.toPrecision(3)));
}
