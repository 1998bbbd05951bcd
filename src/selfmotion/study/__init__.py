"""The paper, whole: every figure, table and claim re-run, its open questions answered."""

from selfmotion.study.engine import Scale
from selfmotion.study.figures import require_matplotlib
from selfmotion.study.page import write
from selfmotion.study.results import Claim, Study, Verdict
from selfmotion.study.run import PARTS, run

__all__ = ["PARTS", "Claim", "Scale", "Study", "Verdict", "require_matplotlib", "run", "write"]
