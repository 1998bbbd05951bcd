"""Verdicts on a motion or a controller's program that was compared with its job."""

from typing import NamedTuple

from selfmotion.certificate import Tolerance


class StepVerdict(NamedTuple):
    """Verdict on one step of a program: a seam, a free move, or an inserted slow motion.

    Attributes
    ----------
    name : str
    verified : bool
    verdict : str
        In one line: verified, or what is violated, and when.
    """

    name: str
    verified: bool
    verdict: str


class ProgramVerdict(NamedTuple):
    """Verdict on a whole program: on its steps, and on what only the whole can violate.

    Attributes
    ----------
    steps : tuple of StepVerdict
    failures : tuple of str
        Faults of the whole: of its ends, its order, its outputs, its header, or of the job itself.
    seam_tolerance : Tolerance or None
        Allowed deviation of seams from their paths; None where each plan's tolerance counts.
    shift_remark : str
        How far the work object was shifted, in words; "" for not at all.
    unjudged_remark : str
        What the controller decides, and no certificate covers, in words.
    """

    steps: tuple[StepVerdict, ...]
    failures: tuple[str, ...]
    seam_tolerance: Tolerance | None = None
    shift_remark: str = ""
    unjudged_remark: str = ""

    @property
    def verified(self) -> bool:
        """Whether every step is verified, and the whole has no fault."""
        return all(step.verified for step in self.steps) and not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or how many steps are not, and the faults of the whole."""
        return self._verified_text if self.verified else self._failure_text

    @property
    def _verified_text(self) -> str:
        remarks = (self._tolerance_remark, self.shift_remark, self.unjudged_remark)
        return "; ".join(["verified: each step, and the whole", *filter(None, remarks)])

    @property
    def _failure_text(self) -> str:
        count = sum(not step.verified for step in self.steps)
        steps = [f"{count} of {len(self.steps)} steps"] if count else []
        shift = [self.shift_remark] if self.shift_remark else []
        return f"not verified: {'; '.join([*steps, *self.failures, *shift])}"

    @property
    def _tolerance_remark(self) -> str:
        if self.seam_tolerance is None:
            return ""
        return (
            f"seams within {1e3 * self.seam_tolerance.position:.3g} mm and "
            f"{self.seam_tolerance.rotation:.2g} rad of their paths"
        )
