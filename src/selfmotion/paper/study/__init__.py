"""The paper, whole: every figure, table and claim re-run, its open questions answered."""

from selfmotion.paper.study.context import Scale as Scale
from selfmotion.paper.study.figures import require_matplotlib as require_matplotlib
from selfmotion.paper.study.page import write as write
from selfmotion.paper.study.results import Claim as Claim, Study as Study, Verdict as Verdict
from selfmotion.paper.study.run import PARTS as PARTS, run as run
