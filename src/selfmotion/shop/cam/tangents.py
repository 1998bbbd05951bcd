"""Tools that point along the path: knives, nozzles, torches."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, PathError

# Which axis of the tool is along the path → the column of its rotation, and its sign.
AXES = {"x": (0, 1.0), "-x": (0, -1.0), "y": (1, 1.0), "-y": (1, -1.0)}
# Angle of a path with the tool's axis below which it has no direction across it [rad].
_ALONG = 1e-3
# A tool turns by more than this at once [rad] in two steps about its axis, as the shortest turn
# would not be known.
_HALF = 0.5 * np.pi


class PathSection(NamedTuple):
    """Poses between two corners: their numbers, first to last, and their rotations (K, 3, 3)."""

    first: int
    last: int
    rotations: Array


def sections_along(
    positions: Array, axes: Array, rapid: Flags, along: str, lean: tuple[float, float], bend: float
) -> list[PathSection]:
    """Return the sections of a path between corners, the tool's axis along it on each.

    In bends the direction is halfway between that of both legs.

    Parameters
    ----------
    positions : (N, 3)
    axes : (N, 3)
        The tool's z axes.
    rapid : (N,)
        Whether the tool goes on from each in a rapid.
    along : {"x", "-x", "y", "-y"}
    lean : (float, float)
        By how much the z axis leans towards where it goes, and to the left of it [rad].
    bend : float
        Legs that bend by more make a corner [rad].

    Raises
    ------
    PathError
        The path goes along the tool's axis everywhere.
    """
    legs = np.diff(positions, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    units = legs / np.maximum(lengths, 1e-300)[:, None]
    across = units - np.einsum("kc,kc->k", units, axes[:-1])[:, None] * axes[:-1]
    sizes = np.linalg.norm(across, axis=1)
    known = (sizes > _ALONG) & (lengths > 0.0)
    if not known.any():
        raise PathError(
            f"along = '{along}': the path goes along the tool's axis, and nowhere across"
        )
    # What goes along the axis keeps the direction before it, or takes that behind it.
    source = np.where(known, np.arange(len(legs)), -1)
    source = np.maximum.accumulate(source)
    source[source < 0] = int(np.argmax(known))
    units = across[source] / sizes[source][:, None]
    cosines = np.einsum("kc,kc->k", units[:-1], units[1:])
    corners = 1 + np.flatnonzero((cosines < np.cos(bend)) | (rapid[:-2] != rapid[1:-1]))
    found = []
    for first, last in pairwise([0, *corners.tolist(), len(positions) - 1]):
        own = units[first:last]
        ahead = np.concatenate([own[:1], own[:-1] + own[1:], own[-1:]])
        found.append(PathSection(first, last, _facing(ahead, axes[first : last + 1], along, lean)))
    return found


def _facing(ahead: Array, axes: Array, along: str, lean: tuple[float, float]) -> Array:
    """Return rotations (K, 3, 3) with z axes, and another axis as far ahead as that allows."""
    lead, tilt = lean
    column, sign = AXES[along]
    ahead = ahead - np.einsum("kc,kc->k", ahead, axes)[:, None] * axes
    ahead = ahead / np.linalg.norm(ahead, axis=1)[:, None]
    cosine, sine = np.cos(lead), np.sin(lead)
    z, forward = cosine * axes + sine * ahead, cosine * ahead - sine * axes
    # Seen from the holder, which is where z comes from, forward × z is to the left.
    z = np.cos(tilt) * z + np.sin(tilt) * np.cross(forward, z)
    one = sign * forward
    other = np.cross(z, one) if column == 0 else np.cross(one, z)
    both = (one, other) if column == 0 else (other, one)
    return np.stack([*both, z], axis=2)


def turning(first: Array, last: Array) -> Sequence[Array]:
    """Return rotations on the spot from one (3, 3) to another, in steps below half a turn."""
    from scipy.spatial.transform import Rotation

    own = first.T @ last
    about = float(np.arctan2(own[1, 0] - own[0, 1], own[0, 0] + own[1, 1]))
    if abs(about) <= _HALF:
        return [first, last]
    middle = first @ Rotation.from_euler("z", 0.5 * about).as_matrix()
    return [first, middle, last]
