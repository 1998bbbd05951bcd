"""What objects show of themselves at a prompt."""

import selfmotion as sm


def test_objects_show_a_few_lines() -> None:
    plan = sm.plan(sm.sample_problem())
    shown = repr(plan).splitlines()
    assert len(shown) == 3
    assert max(map(len, shown)) < 200
    assert plan.certificate.verdict in repr(plan)
    assert f"→ {plan.report.cost:.6g}" in repr(plan)
    for thing, words in (
        (plan.report, plan.report.status.value),
        (plan.trajectory, "joint1, joint2, joint3"),
        (plan.robot, "planar_3r"),
    ):
        assert words in repr(thing)
        assert len(repr(thing).splitlines()) == 1
