// The scene in meshcat's own viewer, with its own controls: what is drawn, and how it moves.

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

function clip(name, { t, position, quaternion }, joint, joints) {
  const keys = (array, width) => Array.from(t, (time, k) => {
    const start = (k * joints + joint) * width;
    return { time, value: Array.from(array.subarray(start, start + width)) };
  });
  return { fps: 1, name, tracks: [
    { name: ".position", type: "vector3", keys: keys(position, 3) },
    { name: ".quaternion", type: "quaternion", keys: keys(quaternion, 4) },
  ] };
}

async function start() {
  const content = await readPayload(document.getElementById("payload").textContent);
  const code = new TextDecoder().decode(await inflate(document.getElementById("viewer").textContent));
  const script = document.createElement("script");
  script.textContent = code;
  document.head.append(script);
  const viewer = new MeshCat.Viewer(document.getElementById("view"));
  const meshes = content.meshes.map(decodeMesh);
  const [plan] = content.plans;
  const hide = (path) => viewer.handle_command({ type: "set_property", path, property: "visible", value: false });
  // The page has lights and a ground of its own.
  for (const path of ["/Lights", "/Grid", "/Axes"]) viewer.handle_command({ type: "delete", path });
  for (const command of [...content.commands, ...plan.commands]) {
    const { object } = command;
    const geometries = object.geometries?.map((geometry) => expandGeometry(geometry, meshes));
    viewer.handle_command(geometries ? { ...command, object: { ...object, geometries } } : command);
  }
  // meshcat lets every object cast a shadow; the light of the sky has none.
  viewer.scene_tree.find(["selfmotion", "stage", "sky"]).object.traverse((object) => { object.castShadow = false; });
  for (const path of ["ghost", "ellipsoid", "bodies"]) hide(`${ROOT}/${path}`);
  for (const { root } of plan.tips) hide(`${root}/start`);
  const { movers } = content;
  const riders = [...plan.tips.filter((tip) => tip.carrier >= 0), ...plan.riders];
  const animations = [
    ...riders.map(({ root, carrier }) => ({ path: root, clip: clip(root, plan.frames, carrier, movers.length) })),
    ...["robot", "bodies"].flatMap((part) => movers.map((node, joint) => (
      { path: `${ROOT}/${part}/${node}`, clip: clip(node, plan.frames, joint, movers.length) }))),
  ];
  viewer.handle_command({ type: "set_animation", animations, options: { play: true, repetitions: 1 } });
  window.viewer = viewer;
  document.documentElement.dataset.replay = "ready";
}

start().catch((error) => {
  document.getElementById("view").textContent = `This browser cannot show the scene: ${error.message}`;
  throw error;
});
