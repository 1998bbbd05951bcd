// What is drawn, by three.js: a tree of nodes with paths, fed by the page's commands; z is up.

// Colours are shown as they are written, not taken for light that a film sees; a light of
// intensity 1 makes what is white white.
const LIGHT = Math.PI;

class Viewer {
  constructor(element) {
    THREE.ColorManagement.enabled = false;
    this.element = element;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.autoUpdate = false;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    element.append(this.renderer.domElement);
    this.scene = new THREE.Scene();
    this.nodes = new Map([["", this.scene]]);
    this.geometries = new Map();
    this.camera = new THREE.PerspectiveCamera(36, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.draw(false));
    // What is done just before each picture.
    this.before = () => {};
  }

  // The node at a path such as "/robot/hand", made where there is none.
  find(path) {
    const known = this.nodes.get(path);
    if (known) return known;
    const cut = path.lastIndexOf("/");
    const node = new THREE.Group();
    node.name = path.slice(cut + 1);
    this.find(path.slice(0, cut)).add(node);
    this.nodes.set(path, node);
    return node;
  }

  run({ type, path, object }, meshes) {
    if (type === "delete") this.remove(path);
    else this.find(path).add(this.made(object, meshes));
    this.draw();
  }

  remove(path) {
    const node = this.nodes.get(path);
    if (!node) return;
    node.removeFromParent();
    const shared = new Set(this.geometries.values());
    node.traverse((item) => {
      if (item.geometry && !shared.has(item.geometry)) item.geometry.dispose();
      item.material?.dispose();
    });
    for (const known of [...this.nodes.keys()]) {
      if (known === path || known.startsWith(`${path}/`)) this.nodes.delete(known);
    }
  }

  // An object as three.js has it, of one as three.js writes it.
  made({ geometries, materials, object }, meshes) {
    const found = object.type.endsWith("Light") ? light(object)
      : new THREE[object.type](this.geometry(geometries[0], meshes), material(materials[0]));
    found.uuid = object.uuid;
    found.receiveShadow = !found.isLight;
    new THREE.Matrix4().fromArray(object.matrix).decompose(found.position, found.quaternion, found.scale);
    return found;
  }

  geometry(given, meshes) {
    if (!("mesh" in given)) return shape(given);
    if (!this.geometries.has(given.mesh)) {
      const { position, index } = meshes[given.mesh];
      this.geometries.set(given.mesh, surface({ vertices: position, triangles: index }));
    }
    return this.geometries.get(given.mesh);
  }

  // Draw with the next picture of the screen; shadows stay where only the view has moved.
  draw(moved = true) {
    if (moved) this.renderer.shadowMap.needsUpdate = true;
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => this.render());
  }

  render() {
    cancelAnimationFrame(this.asked);
    this.before();
    this.asked = undefined;
    this.renderer.render(this.scene, this.camera);
  }

  resize() {
    const { clientWidth: wide, clientHeight: high } = this.element;
    this.camera.aspect = Math.max(wide, 1) / Math.max(high, 1);
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(wide, high);
    // What is resized is empty until it is drawn.
    this.render();
  }

  // The picture as it is now, as an address with all its data.
  image() {
    this.render();
    return this.renderer.domElement.toDataURL();
  }
}

function surface({ vertices, triangles, colors }) {
  const made = new THREE.BufferGeometry();
  made.setAttribute("position", new THREE.BufferAttribute(vertices, 3));
  if (colors) made.setAttribute("color", new THREE.BufferAttribute(colors, 3, true));
  made.setIndex(new THREE.BufferAttribute(triangles, 1));
  made.computeVertexNormals();
  return made;
}

function shape(given) {
  if ("vertices" in given) return surface(given);
  if ("lines" in given) {
    return new THREE.BufferGeometry().setAttribute(
      "position", new THREE.BufferAttribute(new Float32Array(given.lines), 3));
  }
  switch (given.type) {
    case "BoxGeometry": return new THREE.BoxGeometry(given.width, given.height, given.depth);
    case "SphereGeometry":
      return new THREE.SphereGeometry(given.radius, given.widthSegments, given.heightSegments);
    case "CylinderGeometry":
      return new THREE.CylinderGeometry(
        given.radiusTop, given.radiusBottom, given.height, given.radialSegments);
    case "LatheGeometry":
      return new THREE.LatheGeometry(given.points.map(({ x, y }) => new THREE.Vector2(x, y)), given.segments);
    case "PlaneGeometry": return new THREE.PlaneGeometry(given.width, given.height);
  }
  throw new Error(`unknown shape ${given.type}`);
}

function material({ type, uuid, ...look }) {
  const made = new THREE[type](look);
  made.uuid = uuid;
  return made;
}

function light({ type, color, groundColor, intensity, shadow }) {
  if (type === "HemisphereLight") return new THREE.HemisphereLight(color, groundColor, LIGHT * intensity);
  const made = new THREE[type](color, LIGHT * intensity);
  if (shadow) {
    const { camera, mapSize, bias, normalBias, radius } = shadow;
    Object.assign(made.shadow, { bias, normalBias, radius });
    made.shadow.mapSize.set(...mapSize);
    const { left, right, top, bottom, near, far } = camera;
    Object.assign(made.shadow.camera, { left, right, top, bottom, near, far });
  }
  return made;
}
