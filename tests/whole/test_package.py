"""What `import selfmotion` offers and what it leaves alone."""

import inspect
import subprocess
import sys

import selfmotion as sm
from support.doors import named


def test_import_leaves_the_heavy_and_optional_packages_alone() -> None:
    code = (
        "import sys, selfmotion; "
        "print([name for name in ('meshcat', 'matplotlib', 'trimesh', 'yourdfpy', "
        "'typer', 'rich', 'scipy.integrate', 'scipy.interpolate', 'scipy.spatial', "
        "'pydantic', 'tomli_w', 'xacro', 'distributed') "
        "if name in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_every_exported_name_exists_and_is_documented() -> None:
    offered = named(sm)
    assert len(set(offered)) == len(offered) > 100
    for name in offered:
        assert getattr(sm, name).__doc__, name


def test_signatures_show_what_one_would_type() -> None:
    """In help(): no factories, functions or addresses, of anything public."""
    for name in named(sm):
        found = getattr(sm, name)
        members = vars(found) if inspect.isclass(found) else {}
        public = [getattr(found, key) for key in members if not key.startswith("_")]
        for item in [found, *public]:
            if inspect.isfunction(item) or inspect.isclass(item):
                shown = str(inspect.signature(item))
                for strange in ("<factory>", "<function", "<object", " object at", "0x", "<lambda"):
                    assert strange not in shown, f"{name}: {shown}"


def test_the_one_liner() -> None:
    code = "import selfmotion as sm; p = sm.plan(sm.sample_problem()); print(p.report.cost)"
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True
    )
    assert float(result.stdout) < 10.5145


def test_objects_show_themselves_in_a_few_lines() -> None:
    """Neither arrays nor the whole URDF, which a session in a terminal would drown in."""
    problem = sm.sample_problem()
    plan = sm.plan(problem, max_evaluations=2)
    shown = [problem, problem.robot, problem.path, plan, plan.report, plan.trajectory]
    for item in (*shown, plan.certificate, *problem.costs, *problem.constraints):
        text = repr(item)
        assert len(text) < 600
        assert " object at " not in text
    assert "_TaskField" not in str(inspect.signature(sm.Problem))


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
