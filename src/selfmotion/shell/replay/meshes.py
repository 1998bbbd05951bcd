"""Visual meshes, made ready for a page, and the data of a page packed small."""

from __future__ import annotations

import base64
import gzip
import json
import os
import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from selfmotion.basics import Array, RobotError

# Visual meshes, made ready for a page: read, welded, shaded by creases, packed small.
#
# A mesh is kept as positions on a 16-bit grid over its bounding box (at most 1/131070 of the
# mesh's extent off: 4 µm for a link of half a metre) and triangles that refer to them. Every
# triangle of the file is kept unless the caller sets a budget.

_GRID = 65535
# So many mesh files are kept in memory: those of a few arms.
_KEPT = 64
# Edges sharper than this are drawn as edges, flatter ones as part of a smooth surface.
_CREASE = np.cos(np.radians(35.0))

Color = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """Triangles of one colour.

    Attributes
    ----------
    grid : (V, 3) of uint16
        Vertices; vertex k lies at ``origin + step * grid[k]``, in the mesh file's units.
    origin, step : (3,)
        Corner of the bounding box, and one step of the grid per axis.
    faces : (F, 3)
        Indices of each triangle's vertices. Each vertex first appears in order: 0, 1, 2, …
    color : tuple of float, optional
        Red, green, blue, opacity in 0..1 from the file; None when the file gives none.
    """

    grid: npt.NDArray[np.uint16]
    origin: Array
    step: Array
    faces: npt.NDArray[np.int64]
    color: Color | None

    @property
    def vertices(self) -> Array:
        """Vertex positions, (V, 3), in the mesh file's units."""
        return np.asarray(self.origin + self.step * self.grid)


def make_mesh(vertices: Array, faces: npt.NDArray[Any], color: Color | None = None) -> DrawnMesh:
    """Weld equal vertices, then split them again along creases.

    Parameters
    ----------
    vertices : (V, 3)
        Positions; the same position may occur many times.
    faces : (F, 3)
        Triangles. All are kept, degenerate ones as well.
    color : tuple of float, optional
        Red, green, blue, opacity in 0..1.
    """
    origin = vertices.min(axis=0)
    step = np.ptp(vertices, axis=0) / _GRID
    scale = np.divide(1.0, step, out=np.zeros(3), where=step > 0)
    grid = np.rint((vertices - origin) * scale).astype(np.int64)
    keys = (grid[:, 0] << 32) | (grid[:, 1] << 16) | grid[:, 2]
    _, first, welded = np.unique(keys, return_index=True, return_inverse=True)
    points = grid[first]
    corners = welded[np.asarray(faces, dtype=np.int64)]
    corner_vertex = _split_creases(points * step, corners)
    # Number the vertices in the order in which the triangles meet them.
    _, appears, vertex = np.unique(corner_vertex, return_index=True, return_inverse=True)
    order = np.argsort(appears)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return DrawnMesh(
        grid=points[corners.ravel()[appears[order]]].astype(np.uint16),
        origin=origin,
        step=step,
        faces=rank[vertex].reshape(-1, 3),
        color=color,
    )


def _split_creases(points: Array, faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return a label per corner, (3F,): corners with one label share a vertex and its normal.

    Two triangles that meet at an edge share both its vertices unless the edge is a crease.
    """
    normals = np.cross(
        points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    )
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    start = np.arange(faces.size)
    end = start.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    flat = faces.ravel()
    # Corner at the edge's lower vertex first, so that the sides of an edge line up.
    swap = flat[start] > flat[end]
    low, high = np.where(swap, end, start), np.where(swap, start, end)
    keys = flat[low] * len(points) + flat[high]
    order = np.argsort(keys, kind="stable")
    here, there = order[:-1], order[1:]
    cosine = np.einsum("ij,ij->i", normals[here // 3], normals[there // 3])
    smooth = (keys[here] == keys[there]) & (cosine > _CREASE)
    here, there = here[smooth], there[smooth]
    rows = np.concatenate([low[here], high[here]])
    columns = np.concatenate([low[there], high[there]])
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(faces.size,) * 2)
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64)


def read_meshes(
    path: str, owner: str, loaded: Any = None, scale: Array | float = 1.0
) -> list[DrawnMesh]:
    """Read a mesh file, one `DrawnMesh` per colour in it, in the file's units.

    Parameters
    ----------
    path : str
        STL, DAE or OBJ file.
    owner : str
        Whose mesh it is, for messages.
    loaded : coal.BVHModelBase, optional
        What coal has read from the file and multiplied by `scale`; taken where trimesh cannot
        read it. It comes second because it has no colours, and mixes up the triangles of files
        with several meshes.

    scale : (3,) or float
        Metres per unit of the file that `loaded` was made with.

    Raises
    ------
    RobotError
        Neither has triangles for the file.
    """
    found = _drawn(path, *_state(path))
    if not found:
        found = _made(_triangles_of_coal(loaded, scale))
    if not found:
        raise RobotError(
            f"{owner}: no triangles in mesh file {path}; export it again as .stl, .dae or .obj"
        )
    return list(found)


def _state(path: str) -> tuple[int, int]:
    """Return what of a file is other when it was written anew: its time and size."""
    try:
        known = os.stat(path)
    except OSError:
        return 0, 0
    return known.st_mtime_ns, known.st_size


@lru_cache(maxsize=_KEPT)
def _drawn(path: str, time: int, size: int) -> tuple[DrawnMesh, ...]:
    """Return what trimesh reads of a file: once, since many pages show the same arm."""
    return _made(_read_with_trimesh(path))


def _made(parts: dict[Color | None, list[_Triangles]]) -> tuple[DrawnMesh, ...]:
    return tuple(
        make_mesh(
            np.concatenate([vertices for vertices, _ in group]),
            np.concatenate([faces + offset for (_, faces), offset in _with_offsets(group)]),
            color,
        )
        for color, group in parts.items()
    )


_Triangles = tuple[Array, npt.NDArray[np.int64]]


def _with_offsets(group: list[_Triangles]) -> list[tuple[_Triangles, int]]:
    counts = np.cumsum([0] + [len(vertices) for vertices, _ in group[:-1]])
    return [(part, int(count)) for part, count in zip(group, counts, strict=True)]


def _read_with_trimesh(path: str) -> dict[Color | None, list[_Triangles]]:
    import logging

    import trimesh

    # Its complaints about normals and materials concern files we do not own.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        scene = trimesh.load_scene(path, process=False)
    # What trimesh reads with have no error class in common, nor has it one of its own.
    except Exception:
        # Coal may still have read the file.
        return {}
    parts: dict[Color | None, list[_Triangles]] = {}
    for part in scene.dump():
        if not isinstance(part, trimesh.Trimesh) or len(part.faces) == 0:
            continue
        parts.setdefault(_color(part.visual), []).append(
            (np.asarray(part.vertices, dtype=np.float64), np.asarray(part.faces, dtype=np.int64))
        )
    return parts


def _color(visual: Any) -> Color | None:
    if not visual.defined:
        return None
    rgba = np.asarray(visual.material.main_color if visual.kind == "texture" else visual.main_color)
    red, green, blue, opacity = (float(value) / 255.0 for value in rgba)
    # Exporters that confuse opacity with transparency write 0 for a solid part.
    return red, green, blue, opacity or 1.0


def _triangles_of_coal(loaded: Any, scale: Array | float) -> dict[Color | None, list[_Triangles]]:
    if loaded is None or loaded.num_tris == 0:
        return {}
    triangles = [loaded.tri_indices(k) for k in range(loaded.num_tris)]
    faces = np.array([[triangle[0], triangle[1], triangle[2]] for triangle in triangles])
    return {None: [(np.array(loaded.vertices()) / scale, faces)]}


# The data of a page: JSON with arrays beside it, gzipped, in base64.
#
# Layout before compression: length of the JSON (4 bytes, little endian), the JSON in UTF-8, zeros
# up to a multiple of 8, then the arrays, each at a multiple of 8. In the JSON ``{"$": k}`` stands
# for array k of its list ``arrays``. `payload.js` reads it.

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
        data = gzip.compress(self.data(content), compresslevel=6, mtime=0)
        return base64.b64encode(data).decode("ascii")

    def data(self, content: Json) -> bytes:
        """Return `content` and all arrays as bytes: see the layout above."""
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
        return _padded(struct.pack("<I", len(text)) + text) + b"".join(chunks)


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
