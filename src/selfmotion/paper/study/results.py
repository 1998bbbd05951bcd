"""Results of the study, as plain values: content of the report and of the JSON file."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt


class Verdict(Enum):
    """Verdict on a statement of the paper."""

    CONFIRMED = "confirmed"
    QUALIFIED = "qualified"
    REFUTED = "refuted"


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, tested.

    Attributes
    ----------
    key : str
        Short name, for the JSON file.
    statement : str
        Statement of the paper.
    verdict : Verdict
    number : str
        The figure that decides it.
    reason : str
        The test and its result.
    """

    key: str
    statement: str
    verdict: Verdict
    number: str
    reason: str


@dataclass(frozen=True)
class Table:
    """Rows of numbers or words under column heads."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float | int, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class PlottedCurve:
    """A line through points, in a plot."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    marker: str = ""
    faint: bool = False

    @classmethod
    def of(
        cls,
        label: str,
        x: npt.ArrayLike,
        y: npt.ArrayLike,
        *,
        marker: str = "",
        faint: bool = False,
    ) -> PlottedCurve:
        """Return a curve through arrays."""
        return cls(
            label,
            tuple(np.asarray(x, dtype=float).tolist()),
            tuple(np.asarray(y, dtype=float).tolist()),
            marker,
            faint,
        )


@dataclass(frozen=True)
class Plot:
    """A picture of curves; drawn by `study.run`.

    Attributes
    ----------
    name : str
        Of its PNG file.
    title, x_label, y_label : str
    curves : tuple of PlottedCurve
    x_scale, y_scale : {"linear", "log"}
    equal : bool
        Whether a metre is as long upwards as sideways.
    bars : bool
        Bars instead of lines.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[PlottedCurve, ...]
    x_scale: str = "linear"
    y_scale: str = "linear"
    equal: bool = False
    bars: bool = False


@dataclass(frozen=True)
class Chapter:
    """A part of the report.

    Attributes
    ----------
    key, title : str
    paragraphs : tuple of str
        Plain text; every figure in it comes from the run.
    tables, plots, claims : tuple
    """

    key: str
    title: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    plots: tuple[Plot, ...] = ()
    claims: tuple[Claim, ...] = ()


@dataclass(frozen=True)
class Study:
    """The whole study.

    Attributes
    ----------
    chapters : tuple of Chapter
    seconds : float
        Wall time of the run.
    scale : str
        ``"full"`` or ``"reduced"``.
    """

    chapters: tuple[Chapter, ...]
    seconds: float
    scale: str

    @property
    def claims(self) -> tuple[Claim, ...]:
        """All claims, in the report's order."""
        return tuple(claim for chapter in self.chapters for claim in chapter.claims)

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots, in the report's order."""
        return tuple(plot for chapter in self.chapters for plot in chapter.plots)
