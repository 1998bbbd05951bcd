// The 3-D scene: meshcat's viewer, fed from the payload instead of a server.

const ROOT = "/selfmotion";

function attribute(array, itemSize, normalized = false) {
  return { array, itemSize, normalized, type: array.constructor.name };
}

// Geometries that refer to the page's arrays become what three.js's loader expects.
function expandGeometry(geometry, meshes) {
  const attributes = {};
  let index;
  if ("mesh" in geometry) {
    attributes.position = attribute(meshes[geometry.mesh].position, 3);
    index = meshes[geometry.mesh].index;
  } else if ("vertices" in geometry) {
    attributes.position = attribute(geometry.vertices, 3);
    if (geometry.colors) attributes.color = attribute(geometry.colors, 3, true);
    index = geometry.triangles;
  } else if ("lines" in geometry) {
    attributes.position = attribute(new Float32Array(geometry.lines), 3);
  } else {
    return geometry;
  }
  const data = { attributes };
  if (index) data.index = attribute(index, 1);
  return { uuid: geometry.uuid, type: "BufferGeometry", data };
}

function tracks({ t, position, quaternion }, joint, joints) {
  const keys = (array, width) => Array.from(t, (time, k) => {
    const start = (k * joints + joint) * width;
    return { time, value: Array.from(array.subarray(start, start + width)) };
  });
  return [
    { name: ".position", type: "vector3", keys: keys(position, 3) },
    { name: ".quaternion", type: "quaternion", keys: keys(quaternion, 4) },
  ];
}

// Rows of tables at a time, between those at even times.
function between(t, time) {
  const place = Math.min(time / t[t.length - 1], 1) * (t.length - 1);
  const k = Math.min(Math.floor(place), t.length - 2);
  return (table, width) => Array.from({ length: width }, (_, i) => table[width * k + i]
    + (place - k) * (table[width * (k + 1) + i] - table[width * k + i]));
}

class Stage {
  constructor(element, content) {
    this.element = element;
    this.content = content;
    this.viewer = new MeshCat.Viewer(element);
    const resize = this.viewer.set_3d_pane_size.bind(this.viewer);
    // meshcat takes the window's height; the scene is only a part of this page.
    this.viewer.set_3d_pane_size = () => resize(element.clientWidth, element.clientHeight);
    this.turned = false;
    this.marked = [];
    this.kept = new Map();
    new ResizeObserver(() => this.resize()).observe(element);
    this.names = element.appendChild(document.createElement("div"));
    this.names.className = "names";
    const meshes = content.meshes.map(decodeMesh);
    for (const command of content.commands) this.run(command, meshes);
    for (const plan of content.plans) for (const command of plan.commands) this.run(command, meshes);
    this.viewer.controls.addEventListener("start", () => { this.turned = true; });
    this.ball = this.find(`${ROOT}/ellipsoid`);
    this.ball.matrixAutoUpdate = false;
    // meshcat lets every object cast a shadow; here only what is solid does, and only one light.
    this.find(ROOT).traverse((object) => { object.castShadow = false; });
    const solid = content.plans.map((plan) => `${plan.root}/obstacles`);
    for (const path of [`${ROOT}/robot`, `${ROOT}/stage/sun`, ...solid]) {
      this.find(path).traverse((object) => { object.castShadow = true; });
    }
    this.axes = content.movers.map((node) => {
      const axes = new MeshCat.THREE.AxesHelper(content.frameSize);
      axes.visible = false;
      // Seen through what is around it, as a frame in a link is.
      axes.material.depthTest = false;
      axes.renderOrder = 1;
      this.find(`${ROOT}/robot/${node}`).add(axes);
      return axes;
    });
    this.frame();
  }

  // The page's commands stay as they are: another stage runs them, too.
  run(command, meshes) {
    const { object } = command;
    const geometries = object?.geometries?.map((g) => expandGeometry(g, meshes));
    this.viewer.handle_command(geometries ? { ...command, object: { ...object, geometries } } : command);
  }

  find(path) {
    return this.viewer.scene_tree.find(path.split("/").filter(Boolean)).object;
  }

  show(path, visible) {
    this.viewer.handle_command({ type: "set_property", path, property: "visible", value: visible });
  }

  // The plan's links and its ghost's move with meshcat's own animation, last of all commands.
  load(plan) {
    this.back();
    const clips = [];
    const { movers } = this.content;
    const add = (root, frames) => movers.forEach((node, k) => clips.push({
      path: `${root}/${node}`,
      clip: { fps: 1, name: node, tracks: tracks(frames, k, movers.length) },
    }));
    // What rides on a part moves as the joint that carries it.
    const riders = [...plan.tips.filter((tip) => tip.carrier >= 0), ...plan.riders];
    for (const { root, carrier } of riders) {
      clips.push({ path: root, clip: {
        fps: 1, name: root, tracks: tracks(plan.frames, carrier, movers.length) } });
    }
    add(`${ROOT}/robot`, plan.frames);
    add(`${ROOT}/ghost`, plan.ghost);
    if (this.content.layers.some(({ name }) => name === "bodies")) add(`${ROOT}/bodies`, plan.frames);
    this.viewer.handle_command({
      type: "set_animation", animations: clips, options: { play: true, repetitions: 1 } });
    this.viewer.animator.pause();
  }

  // Everything that moves follows the animator's time just before a frame is drawn.
  onRender(callback) {
    const render = this.viewer.render.bind(this.viewer);
    this.viewer.render = () => {
      callback(this.time);
      render();
    };
  }

  get time() {
    const actions = this.viewer.animator.actions;
    return actions.length ? Math.max(...actions.map((action) => action.time)) : 0;
  }

  seek(time) {
    this.back();
    this.viewer.animator.seek(time);
    this.viewer.animator.display_progress(time);
  }

  // Where the tool is, in meshcat's axes with y up.
  toolAt({ tool, t }, time) {
    const [x, y, z] = between(t, time)(tool, 3);
    return new MeshCat.THREE.Vector3(x, z, -y);
  }

  // Go along with a point; the first one only tells where it is.
  accompany(point) {
    if (point && this.seen) {
      const way = point.clone().sub(this.seen);
      this.viewer.camera.position.add(way);
      this.viewer.controls.target.add(way);
      this.viewer.controls.update();
    }
    this.seen = point;
  }

  // Put the links where a self-motion has them: tables of poses by step, time and joint.
  place(plan, time, step) {
    const { THREE } = MeshCat;
    const { t, position, quaternion, steps } = plan.selfMotion;
    const { movers } = this.content;
    const at = (value, count) => {
      const k = Math.min(Math.max(Math.floor(value), 0), count - 2);
      return [k, value - k];
    };
    const [row, ahead] = at((time / t[t.length - 1]) * (t.length - 1), t.length);
    const [side, over] = at(step, steps);
    const cells = [[0, 0], [0, 1], [1, 0], [1, 1]].map(([i, j]) =>
      [((side + i) * t.length + row + j) * movers.length, (i ? over : 1 - over) * (j ? ahead : 1 - ahead)]);
    movers.forEach((node, joint) => {
      const place = new THREE.Vector3();
      const turn = new THREE.Vector4(0, 0, 0, 0);
      for (const [cell, weight] of cells) {
        place.addScaledVector(new THREE.Vector3().fromArray(position, 3 * (cell + joint)), weight);
        const one = new THREE.Vector4().fromArray(quaternion, 4 * (cell + joint));
        turn.addScaledVector(one, one.dot(turn) < 0 ? -weight : weight);
      }
      turn.normalize();
      this.put(plan, node, joint, place, turn);
    });
    this.viewer.set_dirty();
  }

  // Put what moves with a joint somewhere else than the animation has it.
  put(plan, node, joint, place, turn) {
    const moved = [`${ROOT}/robot/${node}`, `${ROOT}/bodies/${node}`,
      ...plan.riders.filter(({ carrier }) => carrier === joint).map(({ root }) => root)];
    for (const object of moved.map((path) => this.find(path))) {
      if (!this.kept.has(object)) this.kept.set(object, [object.position.clone(), object.quaternion.clone()]);
      object.position.copy(place);
      object.quaternion.set(turn.x, turn.y, turn.z, turn.w);
    }
  }

  // Put the links where a configuration has them: each joint is placed in the one before.
  stand(plan, q) {
    const { THREE } = MeshCat;
    const { coordinates, parents, rotations, positions, axes, revolute, scales } = this.content.tree;
    const frames = [new THREE.Matrix4()];
    this.content.movers.forEach((node, joint) => {
      const [a, b, c, d, e, f, g, h, i] = rotations.subarray(9 * joint, 9 * joint + 9);
      const [x, y, z] = positions.subarray(3 * joint, 3 * joint + 3);
      const own = new THREE.Matrix4().set(a, b, c, x, d, e, f, y, g, h, i, z, 0, 0, 0, 1);
      const axis = new THREE.Vector3().fromArray(axes, 3 * joint);
      const by = q[coordinates[joint]] * scales[joint];
      const moved = revolute[joint] ? new THREE.Matrix4().makeRotationAxis(axis, by)
        : new THREE.Matrix4().setPosition(axis.multiplyScalar(by));
      frames.push(frames[parents[joint]].clone().multiply(own).multiply(moved));
      const place = new THREE.Vector3().setFromMatrixPosition(frames[joint + 1]);
      const turn = new THREE.Quaternion().setFromRotationMatrix(frames[joint + 1]);
      this.put(plan, node, joint, place, turn);
    });
    this.viewer.set_dirty();
  }

  // Put the links back: the animator writes nothing that it holds to be where it put it.
  back() {
    for (const [object, [place, turn]] of this.kept) {
      object.position.copy(place);
      object.quaternion.copy(turn);
    }
    this.kept.clear();
  }

  // Write the names of bodies where they are.
  label(paths) {
    const { THREE } = MeshCat;
    const { camera } = this.viewer;
    const wide = this.element.clientWidth, high = this.element.clientHeight;
    this.names.replaceChildren(...Object.entries(paths).flatMap(([name, path]) => {
      const box = new THREE.Box3().setFromObject(this.find(path));
      if (box.isEmpty()) return [];
      const seen = box.getCenter(new THREE.Vector3()).project(camera);
      if (seen.z > 1) return [];
      const text = document.createElement("span");
      text.textContent = name;
      text.style.transform = `translate(${(0.5 + seen.x / 2) * wide}px, ${(0.5 - seen.y / 2) * high}px) translate(-50%, -50%)`;
      return [text];
    }));
  }

  // Place the tool's ellipsoid: a symmetric matrix per sample, interpolated between samples.
  stretch({ matrix, tool, t }, time, size) {
    const at = between(t, time);
    const m = at(matrix, 9).map((value) => size * value);
    const p = at(tool, 3);
    this.ball.matrix.set(
      m[0], m[1], m[2], p[0], m[3], m[4], m[5], p[1], m[6], m[7], m[8], p[2], 0, 0, 0, 1);
    this.ball.matrixWorldNeedsUpdate = true;
  }

  // Tint the named bodies: links, or obstacles of the plan.
  // Bodies that meet are red, the others of a warm tint.
  mark(names, obstacles, meet = false) {
    const wanted = names.map((name) => obstacles[name] ?? this.content.links[name]).filter(Boolean);
    if (String(wanted) === String(this.marked) && meet === this.meet) return;
    this.meet = meet;
    const tint = (paths, color) => paths.forEach((path) => this.find(path).traverse((object) => {
      object.material?.emissive?.setHex(color);
    }));
    tint(this.marked, 0);
    tint(wanted, meet ? 0xe00000 : 0x9c2f00);
    this.marked = wanted;
  }

  resize() {
    this.viewer.set_3d_pane_size();
    if (!this.turned) this.frame();
  }

  // Stand just far enough away that the moving arm and its path fill the window.
  frame(direction = this.content.camera.direction) {
    const { THREE } = MeshCat;
    const { points } = this.content.camera;
    this.seen = undefined;
    // meshcat's camera lives in axes with y up.
    const upright = ([x, y, z]) => new THREE.Vector3(x, z, -y);
    const toEye = upright(direction);
    const right = new THREE.Vector3(0, 1, 0).cross(toEye).normalize();
    const up = toEye.clone().cross(right);
    const camera = this.viewer.camera;
    camera.fov = 36;
    const aspect = Math.max(this.element.clientWidth, 1) / Math.max(this.element.clientHeight, 1);
    const tangent = Math.tan(THREE.MathUtils.degToRad(camera.fov / 2));
    const seen = points.map(upright).map((p) => [p.dot(right), p.dot(up), p.dot(toEye)]);
    // Along each of the picture's axes two lines through the eye bound the scene, with slopes that
    // leave a margin: more at the top, where the verdict stands. An eye at depth d sees all points
    // if its coordinate lies between `high - upper * d` and `low + lower * d`.
    const bounds = [[0, 0.92 * aspect, 0.92 * aspect], [1, 0.92, 0.8]].map(([axis, lower, upper]) => ({
      lower: lower * tangent,
      upper: upper * tangent,
      low: Math.min(...seen.map((p) => p[axis] - lower * tangent * p[2])),
      high: Math.max(...seen.map((p) => p[axis] + upper * tangent * p[2])),
    }));
    const eye = Math.max(...bounds.map((b) => (b.high - b.low) / (b.lower + b.upper)));
    const [x, y] = bounds.map((b) => (b.high - b.upper * eye + b.low + b.lower * eye) / 2);
    const depths = seen.map((p) => p[2]);
    const depth = (Math.min(...depths) + Math.max(...depths)) / 2;
    const target = right.clone().multiplyScalar(x).addScaledVector(up, y).addScaledVector(toEye, depth);
    const distance = eye - depth;
    camera.position.copy(target).addScaledVector(toEye, distance);
    camera.near = distance / 200;
    camera.far = distance * 20;
    this.viewer.controls.target.copy(target);
    this.viewer.controls.update();
    this.turned = false;
    this.viewer.set_dirty();
  }
}
