"""Motions made to deceive are not verified: a sample of `make bench NAME=fuzz-deceptions`."""

from pathlib import Path

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.certificate import bounding
from support.deceptions import ALL_KINDS, deceive

# Of each kind.
COUNT = 6


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_no_deception_is_verified_and_no_true_motion_refused(kind: str, tmp_path: Path) -> None:
    found = [deceive(kind, number, tmp_path) for number in range(COUNT)]
    assert not [item.told for item in found if item.is_false]
    assert not [f"{x.told}: {x.certificate.verdict}" for x in found if x.is_strict]


def test_a_certificate_that_only_looks_is_deceived(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The deceptions are some: sizes at the nodes alone, as bounds, verify untrue motions."""
    honest = bounding._interpolated

    def looks(*arguments: object) -> tuple[Array, Array, Array]:
        _, times, measured = honest(*arguments)  # type: ignore[arg-type]
        return measured, times, measured

    monkeypatch.setattr(bounding, "_interpolated", looks)
    found = [deceive(kind, number, tmp_path) for kind in ("path", "joint") for number in range(25)]
    assert np.sum([item.is_false for item in found]) >= 2
