"""What `import selfmotion` offers and what it leaves alone."""

import ast
import importlib.metadata
import inspect
import re
import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import pytest

import selfmotion as sm
from selfmotion.basics import public_name
from support.doors import of, offered


def test_plans_leave_the_heavy_and_optional_packages_alone() -> None:
    code = (
        "import sys, selfmotion as sm; sm.plan, sm.load_robot, sm.Problem, sm.plan_job; "
        "print([name for name in ('meshcat', 'matplotlib', 'trimesh', 'yourdfpy', "
        "'typer', 'rich', 'scipy.integrate', 'scipy.interpolate', 'scipy.spatial', "
        "'pydantic', 'tomli_w', 'xacro', 'distributed') "
        "if name in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_each_name_is_there_at_once() -> None:
    # In a process in which nothing else has imported what comes later.
    code = "import selfmotion as sm; print(*[name for name in dir(sm) if not hasattr(sm, name)])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == ""


def test_the_version_is_that_of_the_package() -> None:
    assert sm.__version__ == importlib.metadata.version("selfmotion")


# What a first script needs is found in one look.
FEW = 70


def test_every_exported_name_exists_and_is_documented() -> None:
    names = offered(sm)
    assert len(set(names)) == len(names) > 100
    for name in names:
        assert of(sm, name).__doc__, name


def test_the_top_level_is_short_and_nothing_is_there_twice() -> None:
    assert len(sm.__all__) <= FEW
    assert set(sm.__all__) <= set(dir(sm))
    spaced = [name.split(".")[1] for name in offered(sm) if "." in name]
    assert not set(spaced) & set(sm.__all__)
    assert len(set(spaced)) == len(spaced)


def test_the_import_takes_no_library_with_it() -> None:
    """What a script does not use is not imported: numba and Pinocchio take half a second."""
    code = "import selfmotion, sys; print({'numpy', 'numba', 'pinocchio'} & sys.modules.keys())"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "set()"


# `sm.X` or `selfmotion.x.X`, and such a beginning before what an f-string puts in.
_SAID = re.compile(r"\b(?:selfmotion|sm)((?:\.[A-Za-z_]\w*)+)")
_OPEN = re.compile(r"\b(?:selfmotion|sm)\.$")


def misnamed(source: str) -> list[str]:
    """Return which names of ours texts of a module say that are not there, or have moved."""
    tree, found = ast.parse(source), []
    inside = [
        part
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in pairwise(node.values)
    ]
    found += [
        text.value + "{…}"
        for text, put in inside
        if isinstance(text, ast.Constant)
        and _OPEN.search(text.value)
        and isinstance(put, ast.FormattedValue)
    ]
    texts = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    for text in texts:
        for said in _SAID.finditer(text):
            names, thing = said[1].split(".")[1:], sm
            if names[0] in FOLDERS:
                continue
            for name in names:
                if name not in dir(thing) and not _is_module_of(thing, name):
                    found.append(said[0])
                    break
                thing = getattr(thing, name)
    return found


def _is_module_of(thing: object, name: str) -> bool:
    """Import a module of a package, which is not its attribute before; whether there is one."""
    if not hasattr(thing, "__path__"):
        return False
    with suppress(ModuleNotFoundError):
        import_module(f"{thing.__name__}.{name}")
        return True
    return False


# Folders and files that are no namespaces, which docstrings name.
SOURCE = Path(sm.__file__).parent
FOLDERS = {path.stem for path in SOURCE.iterdir()} - set(dir(sm))
# It says of any name where it has moved to.
MOVES = SOURCE / "__init__.py"


def test_texts_name_what_is_there() -> None:
    """Errors and docstrings: no name that has moved, none that never was."""
    wrong = {
        str(path.relative_to(SOURCE)): found
        for path in SOURCE.rglob("*.py")
        if path != MOVES and (found := misnamed(path.read_text("utf-8")))
    }
    assert wrong == {}
    assert misnamed('f"derive from selfmotion.{kind} now"') == ["derive from selfmotion.{…}"]
    assert misnamed('f"selfmotion.Cost, {x} or sm.costs.Cost, sm.costs.Coat"') == [
        "selfmotion.Cost",
        "sm.costs.Coat",
    ]


def test_classes_to_derive_from_are_where_errors_say() -> None:
    for kind in (
        sm.costs.Cost,
        sm.constraints.Constraint,
        sm.paths.Path,
        sm.motion.NullMotion,
        sm.obstacles.Obstacle,
        sm.certificate.Requirement,
    ):
        _, space, name = public_name(kind).split(".")
        assert getattr(getattr(sm, space), name) is kind


def test_what_has_moved_is_found_for_one_version_more() -> None:
    with pytest.warns(DeprecationWarning, match=r"sm\.Circle is sm\.paths\.Circle now"):
        moved = getattr(sm, "Circle")  # noqa: B009
    assert moved is sm.paths.Circle
    with pytest.warns(DeprecationWarning, match=r"sm\.write_sheet is sm\.files\.write_sheet now"):
        moved = getattr(sm, "write_sheet")  # noqa: B009
    assert moved is sm.files.write_sheet
    with pytest.warns(
        DeprecationWarning, match=r"sm\.Binding is sm\.constraints\.ActiveConstraint"
    ):
        moved = getattr(sm, "Binding")  # noqa: B009
    assert moved is sm.constraints.ActiveConstraint
    with pytest.raises(AttributeError, match="has no attribute 'Circel'"):
        _ = sm.Circel


def test_signatures_show_what_one_would_type() -> None:
    """In help(): no factories, functions, addresses or spelt-out unions, of anything public."""
    for name in offered(sm):
        found = of(sm, name)
        members = vars(found) if inspect.isclass(found) else {}
        public = [getattr(found, key) for key in members if not key.startswith("_")]
        for item in [found, *public]:
            if inspect.isfunction(item) or inspect.isclass(item):
                shown = str(inspect.signature(item))
                for strange in (
                    *("<factory>", "<function", "<object", " object at", "0x", "<lambda"),
                    *("_array_like", "_Buffer"),
                ):
                    assert strange not in shown, f"{name}: {shown}"


def test_arrays_are_called_array_like() -> None:
    for make, name in ((sm.Problem, "start"), (sm.paths.Waypoints, "t"), (sm.retime, "velocity")):
        assert str(inspect.signature(make).parameters[name]).startswith(f"{name}: 'npt.ArrayLike")


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
