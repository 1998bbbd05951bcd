"""Tables of task frames for kernels and messages: kinematics, chains, Jacobian columns, rows."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Ints, ProblemError
from selfmotion.model.follow.follow import BoundTaskFrame
from selfmotion.model.follow.follows import Follows
from selfmotion.model.robot import Chain, null_space


class TipKinematics:
    """Forward kinematics and Jacobians of all tips at one configuration, with data of their own.

    Parameters
    ----------
    chains : sequence of Chain
        Chains of one kinematic tree.

    Attributes
    ----------
    tips : list of Kinematics
        Kinematics of each tip; they share one data object.
    """

    def __init__(self, chains: Sequence[Chain]) -> None:
        first = chains[0].kinematics()
        self.tips = [first, *(chain.kinematics(first.data) for chain in chains[1:])]
        count, dof = len(chains), chains[0].dof
        self._jacobians = np.zeros((count, 6, dof))
        self._rotations, self._translations = np.zeros((count, 3, 3)), np.zeros((count, 3))

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """Return Jacobians (F, 6, n), rotations (F, 3, 3) and translations (F, 3) at q (n,).

        The arrays are overwritten by the next call.
        """
        for f, tip in enumerate(self.tips):
            self._jacobians[f] = tip.at(q) if f == 0 else tip.beside()
            self._rotations[f], self._translations[f] = tip.rotation, tip.translation
        return self._jacobians, self._rotations, self._translations


def kinematics_of(follows: Follows) -> TipKinematics:
    """Return the kinematics of all tips with own data, for repeated calls."""
    return TipKinematics([item.chain for item in follows.items])


def single_tip(follows: Follows) -> BoundTaskFrame:
    """Return the only tip.

    Raises
    ------
    ProblemError
        There are several.
    """
    if len(follows.items) > 1:
        raise ProblemError(
            f"{follows.robot.name}: {len(follows.items)} frames follow paths of their own, which "
            f"is not supported here, only one"
        )
    return follows.items[0]


def linear_rows(follows: Follows) -> Array:
    """Return 1 for rows in metres, 0 for those in radians, (m,)."""
    return np.concatenate([item.task.rows < 3 for item in follows.items]).astype(np.float64)


def row_names(follows: Follows) -> tuple[str, ...]:
    """Return the names of the rows, (m)."""
    return tuple(name for item in follows.items for name in item.task.row_names)


def chain_tables(follows: Follows) -> Array:
    """Return the tables of the chains for compiled kernels, padded, (F, c + 1, 6, 3)."""
    tables = [item.chain.table for item in follows.items]
    padded = np.zeros((len(tables), max(map(len, tables)), *tables[0].shape[1:]))
    for row, table in zip(padded, tables, strict=True):
        row[: len(table)] = table
    return padded


def joint_columns(follows: Follows, q: Array) -> tuple[Array, Ints] | None:
    """Return the Jacobian columns of every physical joint, and the coordinates that move them.

    Columns at q (S, n), (S, F, 6, W), and for each frame the order of the columns with those of its
    chain first, then in a last row the coordinate of each column, (F + 1, W). Derivatives of
    Jacobians need them, see `selfmotion.model.kernels.tool`. None where no joint mimics another:
    the columns of coordinates suffice.
    """
    if not any(item.chain.is_coupled for item in follows.items):
        return None
    coordinates = [item.chain.coordinates for item in follows.items]
    offsets = np.cumsum([0, *map(len, coordinates)])
    columns = np.zeros((len(q), len(follows.items), 6, int(offsets[-1])))
    orders = []
    for f, item in enumerate(follows.items):
        span = slice(int(offsets[f]), int(offsets[f + 1]))
        columns[:, f, :, span] = item.chain.every_along(q)
        others = np.delete(np.arange(offsets[-1]), span)
        orders.append(np.append(np.arange(offsets[-1])[span], others))
    return columns, np.array([*orders, np.concatenate(coordinates)])


def null_basis(follows: Follows, q: Array) -> Array:
    """Return an orthonormal basis of the self-motion's directions at q (n,), (n, r)."""
    return null_space(follows.jacobian(q))
