"""The data of a page: JSON with arrays beside it, gzipped, in base64.

Layout before compression: length of the JSON (4 bytes, little endian), the JSON in UTF-8, zeros up
to a multiple of 8, then the arrays, each at a multiple of 8. In the JSON ``{"$": k}`` stands for
array k of its list ``arrays``. `payload.js` reads it.
"""

from __future__ import annotations

import base64
import gzip
import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.replay.meshes import DrawnMesh

_TYPES = {
    "u1": "Uint8Array",
    "u2": "Uint16Array",
    "u4": "Uint32Array",
    "f4": "Float32Array",
    "f8": "Float64Array",
}

Json = dict[str, Any]


class Payload:
    """Collects arrays, then packs them with the JSON that refers to them."""

    def __init__(self) -> None:
        self._arrays: list[npt.NDArray[Any]] = []

    def array(self, values: npt.ArrayLike, dtype: str = "f4") -> Json:
        """Add an array, flattened row by row; return what stands for it in the JSON."""
        self._arrays.append(np.ascontiguousarray(values, dtype=f"<{dtype}").ravel())
        return {"$": len(self._arrays) - 1}

    def mesh(self, mesh: DrawnMesh) -> Json:
        """Add a mesh in a form that compresses well: see `grid_codes` and `face_codes`."""
        faces = face_codes(mesh.faces)
        return {
            "grid": self.array(grid_codes(mesh.grid), "u2"),
            "origin": mesh.origin.tolist(),
            "step": mesh.step.tolist(),
            "faces": self.array(faces, "u2" if faces.max(initial=0) < 2**16 else "u4"),
        }

    def pack(self, content: Json) -> str:
        """Return `content` and all arrays as base64 text, the same for the same input."""
        layout, chunks, offset = [], [], 0
        for array in self._arrays:
            layout.append([_TYPES[array.dtype.str[1:]], offset, array.size])
            chunks.append(_padded(array.tobytes()))
            offset += len(chunks[-1])
        text = json.dumps(
            {**content, "arrays": layout},
            ensure_ascii=False,
            allow_nan=False,
            separators=(",", ":"),
        ).encode()
        data = _padded(struct.pack("<I", len(text)) + text) + b"".join(chunks)
        return base64.b64encode(gzip.compress(data, compresslevel=6, mtime=0)).decode("ascii")


def grid_codes(grid: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """Return the differences between successive vertices, modulo 2¹⁶, axis by axis: (3, V)."""
    return np.asarray(np.diff(grid, axis=0, prepend=np.zeros((1, 3), dtype=np.uint16)).T)


def face_codes(faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return each index as its distance below the first index not used yet: mostly 0, never < 0."""
    flat = faces.ravel()
    unused = np.maximum.accumulate(np.concatenate([[-1], flat[:-1]])) + 1
    return np.asarray(unused - flat)


def _padded(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 8)
