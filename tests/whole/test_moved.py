"""Full paths of before say where things are now."""

from importlib import import_module

import pytest

from selfmotion.moved import MOVED, MOVED_MODULES


@pytest.mark.parametrize("old", sorted(set(MOVED) - {"problem", "planning", "paper"}))
def test_a_package_that_has_moved_says_where_it_is(old: str) -> None:
    now = f"selfmotion.{MOVED[old]}"
    with pytest.raises(ModuleNotFoundError, match=rf"^selfmotion\.{old} is {now} now$"):
        import_module(f"selfmotion.{old}")
    import_module(now)


def test_modules_of_packages_that_have_moved_say_where_they_are() -> None:
    for old, now in (
        ("problem.fit", "problem.problem.fit"),
        ("planning.steps", "planning.planner.steps"),
        ("paper.ends", "planning.paper.ends"),
    ):
        with pytest.raises(ModuleNotFoundError, match=f"is selfmotion.{now} now$"):
            import_module(f"selfmotion.{old}")
        import_module(f"selfmotion.{now}")


@pytest.mark.parametrize("old", sorted(MOVED_MODULES))
def test_a_module_that_has_another_name_says_which(old: str) -> None:
    now = f"selfmotion.{MOVED_MODULES[old]}"
    assert import_module(now)
    with pytest.raises(ModuleNotFoundError, match=f"selfmotion.{old} is {now} now"):
        import_module(f"selfmotion.{old}")


def test_what_never_was_there_is_not_said_to_have_moved() -> None:
    for name in ("problem.nothing", "planning.nothing", "nothing"):
        with pytest.raises(ModuleNotFoundError, match=r"^No module named"):
            import_module(f"selfmotion.{name}")


def test_problems_and_plans_are_imported_as_before() -> None:
    assert import_module("selfmotion.problem").Problem
    assert import_module("selfmotion.planning").plan
