"""Problems with a known motion that a change of the solver lost once."""

import known
import pytest

import selfmotion as sm

pytestmark = pytest.mark.site


def test_where_fewer_nodes_break_a_tilt_between_them_more_are_kept() -> None:
    """On more nodes the search ends on its way; what it has there keeps the tilt, and will do."""
    problem, _, _ = known.problem_of("turn upright", 1)
    assert sm.plan(problem).certificate.verified
