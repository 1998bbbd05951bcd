// Handles in the scene: what can be dragged, by three.js's own controls.

const HANDLE = 0x2f5fd0;
const HANDLE_SIZE = 0.022;
// A drag tells the server where it is no more often than this [ms].
const TELL_EVERY = 33;

class Handles {
  // onDrag(name, matrix, final); onChoose(handle or undefined)
  constructor(stage, radius, onDrag, onChoose) {
    this.stage = stage;
    this.radius = radius;
    this.onDrag = onDrag;
    this.onChoose = onChoose;
    this.shown = new Map();
    const { viewer } = stage;
    const canvas = viewer.renderer.domElement;
    this.controls = new THREE.TransformControls(viewer.camera, canvas);
    this.controls.setSize(0.75);
    viewer.scene.add(this.controls.getHelper());
    this.controls.addEventListener("change", () => viewer.draw(false));
    this.controls.addEventListener("dragging-changed", ({ value }) => this.grip(value));
    this.controls.addEventListener("objectChange", () => this.dragged());
    // A press that is no drag of the view chooses what is under it.
    let pressed;
    canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      const still = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4;
      if (still && !this.gripped && !this.controls.axis && !stage.isMeasured) this.pick(event);
      pressed = undefined;
    });
  }

  get chosen() { return this.shown.get(this.name)?.handle; }

  // Show the handles of a document; the one that is dragged stays where it is held.
  update(handles) {
    const named = new Map(handles.map((handle) => [handle.name, handle]));
    for (const name of [...this.shown.keys()]) if (!named.has(name)) this.drop(name);
    for (const handle of handles) {
      const { mark } = this.shown.get(handle.name) ?? {};
      const held = this.gripped && handle.name === this.name;
      const object = mark ?? this.made(handle);
      if (!held) object.userData.place(handle.matrix);
      this.shown.set(handle.name, { mark: object, handle });
    }
    if (this.name && !this.shown.has(this.name)) this.choose(undefined);
    if (this.gripped) this.carry();
  }

  made(handle) {
    const mark = new THREE.Mesh(
      new THREE.SphereGeometry(HANDLE_SIZE * this.radius, 20, 12),
      new THREE.MeshBasicMaterial({ color: HANDLE, transparent: true, opacity: 0.75, depthTest: false }));
    mark.renderOrder = 2;
    mark.userData.name = handle.name;
    mark.userData.place = (matrix) => {
      new THREE.Matrix4().fromArray(matrix).decompose(mark.position, mark.quaternion, new THREE.Vector3());
    };
    (handle.node ? this.stage.find(handle.node) : this.stage.viewer.scene).add(mark);
    return mark;
  }

  drop(name) {
    const { mark } = this.shown.get(name);
    mark.removeFromParent();
    mark.geometry.dispose();
    mark.material.dispose();
    this.shown.delete(name);
  }

  pick(event) {
    const box = event.target.getBoundingClientRect();
    const at = new THREE.Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.stage.viewer.camera);
    const marks = [...this.shown.values()].map(({ mark }) => mark).filter(({ visible }) => visible);
    const [hit] = ray.intersectObjects(marks, false);
    if (hit) this.choose(hit.object.userData.name);
  }

  choose(name) {
    this.name = name;
    const { mark, handle } = this.shown.get(name) ?? {};
    if (mark) this.controls.attach(mark);
    else this.controls.detach();
    for (const [other, { mark: object }] of this.shown) object.visible = other !== name;
    if (handle) this.setTurns(handle.moves ? this.turns && handle.turns : true);
    this.onChoose(handle);
    this.stage.viewer.draw();
  }

  // Whether the handle turns what it holds, rather than moving it.
  setTurns(turns) {
    this.turns = turns;
    this.controls.setMode(turns ? "rotate" : "translate");
    this.controls.setSpace(turns ? "local" : "world");
    this.stage.viewer.draw();
  }

  grip(held) {
    this.stage.viewer.controls.enabled = !held;
    this.gripped = held;
    if (!held) this.tell(true);
  }

  dragged() {
    this.carry();
    if (performance.now() - (this.told ?? 0) >= TELL_EVERY) this.tell(false);
  }

  tell(final) {
    const { mark } = this.shown.get(this.name) ?? {};
    if (!mark) return;
    this.told = performance.now();
    mark.updateMatrix();
    this.onDrag(this.name, mark.matrix.toArray(), final);
  }

  // What belongs to the handle goes along at once, before the server draws it anew.
  carry() {
    const { mark, handle } = this.shown.get(this.name) ?? {};
    if (!mark || handle.node) return;
    mark.updateMatrix();
    const by = mark.matrix.clone().multiply(new THREE.Matrix4().fromArray(handle.matrix).invert());
    for (const path of handle.nodes) {
      const node = this.stage.viewer.nodes.get(path);
      if (node) by.decompose(node.position, node.quaternion, new THREE.Vector3());
    }
    this.stage.viewer.draw();
  }

  // What went along is drawn where it is: put its nodes back.
  settle() {
    for (const { handle } of this.shown.values()) {
      if (handle.node) continue;
      for (const path of handle.nodes) {
        const node = this.stage.viewer.nodes.get(path);
        node?.position.set(0, 0, 0);
        node?.quaternion.identity();
      }
    }
  }
}
