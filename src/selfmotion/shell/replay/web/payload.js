// Unpacks the page's data: see payload.py for the layout.

async function inflate(base64) {
  const bytes = Uint8Array.from(atob(base64.trim()), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

const ARRAY_TYPES = { Uint8Array, Uint16Array, Uint32Array, Float32Array, Float64Array };

async function readPayload(base64) {
  return revivePayload(await inflate(base64));
}

function revivePayload(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const content = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const start = Math.ceil((4 + length) / 8) * 8;
  const arrays = content.arrays.map(
    ([type, offset, count]) => new ARRAY_TYPES[type](buffer, start + offset, count));
  const revive = (value) => {
    if (value === null || typeof value !== "object") return value;
    if ("$" in value) return arrays[value.$];
    for (const key in value) value[key] = revive(value[key]);
    return value;
  };
  delete content.arrays;
  return revive(content);
}

// Vertices are differences on a grid, axis by axis; faces count back from the first unused vertex.
function decodeMesh({ grid, origin, step, faces }) {
  const count = grid.length / 3;
  const position = new Float32Array(grid.length);
  for (let axis = 0; axis < 3; axis++) {
    let place = 0;
    for (let k = 0; k < count; k++) {
      place = (place + grid[axis * count + k]) & 0xffff;
      position[3 * k + axis] = origin[axis] + step[axis] * place;
    }
  }
  const index = new Uint32Array(faces.length);
  let unused = 0;
  for (let k = 0; k < faces.length; k++) {
    index[k] = unused - faces[k];
    if (faces[k] === 0) unused++;
  }
  return { position, index };
}
