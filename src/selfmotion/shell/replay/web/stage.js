// The 3-D scene: the arm, what stands around it, and the plans' traces; the arm at any time.

const ROOT = "/selfmotion";

// Rows of tables at a time, between those at even times.
function between(t, time) {
  const place = Math.min(time / t[t.length - 1], 1) * (t.length - 1);
  const k = Math.min(Math.floor(place), t.length - 2);
  return (table, width) => Array.from({ length: width }, (_, i) => table[width * k + i]
    + (place - k) * (table[width * (k + 1) + i] - table[width * k + i]));
}

// Which section of a table of times has a time in it, and the share of it that is over.
function section(t, time) {
  let [low, high] = [0, t.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle; else high = middle;
  }
  return [low, Math.min(Math.max((time - t[low]) / (t[low + 1] - t[low]), 0), 1)];
}

class Stage {
  constructor(element, content) {
    this.element = element;
    this.content = content;
    this.viewer = new Viewer(element);
    this.turned = false;
    // Points besides those of the motion that a view takes in.
    this.also = () => [];
    this.marked = [];
    this.time = 0;
    new ResizeObserver(() => this.resize()).observe(element);
    this.names = element.appendChild(document.createElement("div"));
    this.names.className = "names";
    this.apart = element.appendChild(document.createElement("div"));
    this.apart.className = "apart";
    this.meshes = content.meshes.map(decodeMesh);
    for (const command of content.commands) this.viewer.run(command, this.meshes);
    this.viewer.controls.addEventListener("start", () => { this.turned = true; });
    this.ball = this.find(`${ROOT}/ellipsoid`);
    this.ball.matrixAutoUpdate = false;
    // Only what is solid casts a shadow, of only one light.
    for (const path of [`${ROOT}/robot`, `${ROOT}/stage/sun`]) this.castShadow(path);
    for (const plan of content.plans) this.add(plan);
    this.axes = content.movers.map((node) => {
      const axes = new THREE.AxesHelper(content.frameSize);
      axes.visible = false;
      // Seen through what is around it, as a frame in a link is.
      axes.material.depthTest = false;
      axes.renderOrder = 1;
      this.find(`${ROOT}/robot/${node}`).add(axes);
      return axes;
    });
    this.frame();
  }

  // Draw what belongs to a plan.
  add(plan) {
    for (const command of plan.commands) this.viewer.run(command, this.meshes);
    this.castShadow(`${plan.root}/obstacles`);
  }

  // Draw a plan in place of another one at the same node.
  replace(plan) {
    this.viewer.remove(plan.root);
    this.marked = [];
    this.add(plan);
  }

  // Draw objects in place of those at their nodes.
  redraw(commands) {
    for (const { path } of commands) this.viewer.remove(path);
    for (const command of commands) this.viewer.run(command, this.meshes);
    this.castShadow(`${ROOT}/robot`);
  }

  // The arm without its colours, as long as it shows an older motion, or one that is not verified.
  setGrey(grey) {
    this.find(`${ROOT}/robot`).traverse(({ isMesh, material, userData }) => {
      if (!isMesh || material.depthTest === false) return;
      userData.color ??= material.color.getHex();
      const { r, g, b } = new THREE.Color(userData.color);
      const light = 0.25 + 0.35 * ((r + g + b) / 3);
      if (grey) material.color.setRGB(light, light, light);
      else material.color.setHex(userData.color);
    });
    this.viewer.draw();
  }

  // A line between two points with its number; without them none.
  connect(ends, text = "", near = false) {
    this.ends = ends;
    this.apart.replaceChildren();
    if (!ends) {
      this.viewer.remove(`${ROOT}/apart`);
      this.viewer.draw(false);
      return;
    }
    const points = ends.map((point) => new THREE.Vector3(...point));
    this.line(`${ROOT}/apart`, points, near ? 0xe8701a : 0x5b6f8f);
    const span = document.createElement("span");
    span.textContent = text;
    span.classList.toggle("near", near);
    this.apart.append(span);
    this.follow();
  }

  // The number is where the line is, however the scene is looked at.
  follow() {
    const [span] = this.apart.children;
    if (!span || !this.ends) return;
    const [one, other] = this.ends.map((point) => new THREE.Vector3(...point));
    this.write(span, one.lerp(other, 0.5));
  }

  // Draw a line through points, over all that is in front of it.
  line(path, points, color) {
    this.viewer.remove(path);
    const geometry = new THREE.BufferGeometry().setFromPoints(points);
    const line = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color, depthTest: false }));
    line.renderOrder = 1;
    this.find(path).add(line);
    this.viewer.draw();
  }

  castShadow(path) {
    this.find(path).traverse((object) => { object.castShadow = true; });
  }

  find(path) {
    return this.viewer.find(path);
  }

  show(path, visible) {
    this.find(path).visible = visible;
    this.viewer.draw();
  }

  // From now on the links move as a plan says, their ghosts as its minimum-norm motion does.
  load(plan) {
    const { movers } = this.content;
    const tree = (root, frames) => movers.map((node, joint) => [this.find(`${root}/${node}`), frames, joint]);
    // What rides on a part moves as the joint that carries it.
    const riders = [...plan.tips.filter((tip) => tip.carrier >= 0), ...plan.riders];
    this.moved = [
      ...riders.map(({ root, carrier }) => [this.find(root), plan.frames, carrier]),
      ...tree(`${ROOT}/robot`, plan.frames),
      ...tree(`${ROOT}/ghost`, plan.ghost),
      ...tree(`${ROOT}/bodies`, plan.frames),
    ];
  }

  // Something is done just before each picture, where whatever it shows may be brought up to date.
  onRender(callback) {
    this.viewer.before = () => {
      callback(this.time);
      this.follow();
    };
  }

  seek(time) {
    this.time = time;
    const { length } = this.content.movers;
    const [from, to] = [new THREE.Quaternion(), new THREE.Quaternion()];
    for (const [object, { t, position, quaternion }, joint] of this.moved) {
      const [k, share] = section(t, time);
      const [here, there] = [k * length + joint, (k + 1) * length + joint];
      object.position.fromArray(position, 3 * here).lerp(
        new THREE.Vector3().fromArray(position, 3 * there), share);
      object.quaternion.copy(from.fromArray(quaternion, 4 * here)).slerp(to.fromArray(quaternion, 4 * there), share);
    }
    this.viewer.draw();
  }

  // Where the tool is.
  toolAt({ tool, t }, time) {
    return new THREE.Vector3(...between(t, time)(tool, 3));
  }

  // Go along with a point; the first one only tells where it is.
  accompany(point) {
    if (point && this.seen && !point.equals(this.seen)) {
      const way = point.clone().sub(this.seen);
      this.viewer.camera.position.add(way);
      this.viewer.controls.target.add(way);
      this.viewer.controls.update();
    }
    this.seen = point;
  }

  // Put the links where a self-motion has them: tables of poses by step, time and joint.
  place(plan, time, step) {
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
    this.viewer.draw();
  }

  // Put what moves with a joint somewhere else than the plan has it, until the next time.
  put(plan, node, joint, place, turn) {
    const moved = [`${ROOT}/robot/${node}`, `${ROOT}/bodies/${node}`,
      ...plan.riders.filter(({ carrier }) => carrier === joint).map(({ root }) => root)];
    for (const object of moved.map((path) => this.find(path))) {
      object.position.copy(place);
      object.quaternion.set(turn.x, turn.y, turn.z, turn.w);
    }
  }

  // Put the links where a configuration has them: each joint is placed in the one before.
  stand(plan, q) {
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
    this.viewer.draw();
  }

  // Put a text where a point is seen; false where it is behind the eye.
  write(text, point) {
    const { x, y, z } = point.clone().project(this.viewer.camera);
    const wide = this.element.clientWidth, high = this.element.clientHeight;
    text.style.transform = `translate(${(0.5 + x / 2) * wide}px, ${(0.5 - y / 2) * high}px) translate(-50%, -50%)`;
    return z <= 1;
  }

  // Write the names of bodies where they are.
  label(paths) {
    this.names.replaceChildren(...Object.entries(paths).flatMap(([name, path]) => {
      const box = new THREE.Box3().setFromObject(this.find(path));
      if (box.isEmpty()) return [];
      const text = document.createElement("span");
      text.textContent = name;
      return this.write(text, box.getCenter(new THREE.Vector3())) ? [text] : [];
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
    this.viewer.resize();
    if (!this.turned) this.frame();
  }

  // Stand just far enough away that the moving arm and its path fill the window.
  frame(direction = this.content.camera.direction) {
    const points = [...this.content.camera.points, ...this.also()];
    this.seen = undefined;
    const vector = (xyz) => new THREE.Vector3(...xyz);
    const toEye = vector(direction);
    const right = new THREE.Vector3(0, 0, 1).cross(toEye).normalize();
    const up = toEye.clone().cross(right);
    const camera = this.viewer.camera;
    const aspect = Math.max(this.element.clientWidth, 1) / Math.max(this.element.clientHeight, 1);
    const tangent = Math.tan(THREE.MathUtils.degToRad(camera.fov / 2));
    const seen = points.map(vector).map((p) => [p.dot(right), p.dot(up), p.dot(toEye)]);
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
    camera.updateProjectionMatrix();
    this.viewer.controls.target.copy(target);
    this.viewer.controls.update();
    this.turned = false;
    this.viewer.draw();
  }
}
