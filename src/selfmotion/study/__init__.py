"""The paper, whole: every figure, table and claim re-run, its open questions answered."""

from selfmotion.study.context import Scale as Scale
from selfmotion.study.page import require_matplotlib as require_matplotlib, write as write
from selfmotion.study.results import Claim as Claim, Study as Study, Verdict as Verdict
from selfmotion.study.run import PARTS as PARTS, run as run
