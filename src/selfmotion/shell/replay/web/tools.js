// Tools of every page: joints jogged by hand, and distances measured between two points.

// Joints, each with a slider; the arm stands where they say until the motion goes on.
class Jog {
  constructor(page) {
    this.page = page;
    this.inputs = page.content.joints.map(({ name, unit, lower, upper }, k) => {
      const line = element(get("jogs"), "label", {});
      element(line, "span", {}, name);
      const input = element(line, "input", {
        type: "range", min: lower ?? -Math.PI, max: upper ?? Math.PI, step: "any", "data-joint": name, "aria-label": name });
      const output = element(line, "output", {});
      input.addEventListener("input", () => this.move(k, Number(input.value)));
      return { input, output, unit };
    });
    get("jog").addEventListener("toggle", () => this.show());
  }

  // The configuration of the motion at a time, from its curves.
  at(time) {
    const { t, q } = this.page.plan.curves;
    return between(t, time)(q, this.inputs.length);
  }

  move(joint, value) {
    this.page.pause();
    const q = [...(this.page.standing ?? this.at(this.page.now))];
    q[joint] = value;
    this.page.stand(q, "", "jogged by hand; the motion goes on from the slider of time");
    this.show();
  }

  show() {
    if (!get("jog").open) return;
    const q = this.page.standing ?? this.at(this.page.now);
    this.inputs.forEach(({ input, output, unit }, k) => {
      if (document.activeElement !== input) input.value = q[k];
      output.textContent = spoken(q[k], unit);
    });
  }
}

// Two presses in the scene: a line between them, and how long it is.
class Measure {
  constructor(stage) {
    this.stage = stage;
    this.points = [];
    const canvas = stage.viewer.renderer.domElement;
    let pressed;
    get("measure").addEventListener("click", () => this.set(!this.on));
    canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (!this.on || !pressed) return;
      if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4) this.press(event);
    });
  }

  set(on) {
    this.on = this.stage.isMeasured = on;
    this.clear();
    get("measure").setAttribute("aria-pressed", on);
    get("measured").textContent = on ? "press two points" : "";
  }

  clear() {
    this.points = [];
    this.stage.viewer.remove("/measure");
    this.stage.viewer.draw();
  }

  press(event) {
    const { viewer } = this.stage;
    const box = event.target.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height), viewer.camera);
    const [hit] = ray.intersectObject(this.stage.find(ROOT), true).filter(({ object }) => object.isMesh && seen(object));
    if (!hit) return;
    if (this.points.length === 2) this.clear();
    this.points.push(hit.point);
    const [one, other] = this.points;
    get("measured").textContent = other ? `${(1e3 * one.distanceTo(other)).toFixed(1)} mm` : "and another one";
    if (other) this.stage.line("/measure", [one, other], 0x2f5fd0);
  }
}

// Whether an object and all that it is in are shown.
function seen(object) {
  for (let node = object; node; node = node.parent) if (!node.visible) return false;
  return true;
}

// Offer a file to be kept.
function offer(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
