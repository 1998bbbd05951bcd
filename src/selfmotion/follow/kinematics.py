"""Where all tips are that are followed, stacked."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.robot import Chain


class TipKinematics:
    """Asks for all tips at once, with data of their own.

    Parameters
    ----------
    chains : sequence of Chain
        Of one tree.

    Attributes
    ----------
    each : list of Kinematics
        They share their data.
    """

    def __init__(self, chains: Sequence[Chain]) -> None:
        first = chains[0].kinematics()
        self.each = [first, *(chain.kinematics(first.data) for chain in chains[1:])]
        count, dof = len(chains), chains[0].dof
        self._jacobians = np.zeros((count, 6, dof))
        self._rotations, self._translations = np.zeros((count, 3, 3)), np.zeros((count, 3))

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """Return Jacobians (F, 6, n), rotations (F, 3, 3) and translations (F, 3) at q (n,).

        Valid until the next call.
        """
        for f, tip in enumerate(self.each):
            self._jacobians[f] = tip.at(q) if f == 0 else tip.beside()
            self._rotations[f], self._translations[f] = tip.rotation, tip.translation
        return self._jacobians, self._rotations, self._translations
