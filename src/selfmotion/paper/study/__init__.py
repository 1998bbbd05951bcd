"""The paper, whole: every figure, table and claim re-run, its open questions answered."""

from selfmotion.paper.study.context import Scale as Scale
from selfmotion.paper.study.results import Claim as Claim, Study as Study, Verdict as Verdict
from selfmotion.paper.study.run import (
    PARTS as PARTS,
    require_matplotlib as require_matplotlib,
    run as run,
    write as write,
)
