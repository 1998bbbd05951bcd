"""What tests take: a kept list by which the longest files come first, and cheap tests are chosen.

    pytest --keep-durations      writes tests/durations.csv, as `make test` does
    pytest --below 0.1           only tests that take less than this [s of the processor]
    pytest --arms few            laws that are checked on many arms on three of them

The list holds what took more than `LEAST`, of tests by their ids, and of fixtures that several
tests share by their file and name; what is not on it counts as cheap.
"""

import contextlib
import csv
import os
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

from selfmotion import NAMED_ARMS

TESTS = Path(__file__).resolve().parents[1]
KEPT = TESTS / "durations.csv"
# What is listed takes this at least [s of the processor].
LEAST = 0.05
# On these the laws are checked where `--arms few`: redundancy 1 and 2, with limits and without.
FEW = {("planar_3r", "planar"), ("panda", "pose"), ("ur5", "pointing")}
_SCOPES = ("module", "package", "session", "class")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("durations")
    group.addoption("--keep-durations", action="store_true", help="write tests/durations.csv")
    group.addoption("--below", type=float, help="only tests that take less than this [s]")
    group.addoption("--arms", choices=("few", "all"), default="all", help="for laws by arm")


def kept() -> dict[str, float]:
    """Return what tests and shared fixtures took when it was last written [s]."""
    if not KEPT.exists():
        return {}
    with KEPT.open(newline="") as file:
        return {row["name"]: float(row["seconds"]) for row in csv.DictReader(file)}


def _spent() -> float:
    """Return the time of the processor that this process and all that it began took [s]."""
    times = os.times()
    ended = times.user + times.system + times.children_user + times.children_system
    return ended + _still_running(os.getpid()) / os.sysconf("SC_CLK_TCK")


def _still_running(pid: int) -> float:
    """Return the ticks of all processes below one that have not ended, such as browsers."""
    found = 0.0
    # What ends meanwhile is counted by who waits for it; where there is no /proc, only that is.
    with contextlib.suppress(OSError):
        for task in os.listdir(f"/proc/{pid}/task"):
            for child in Path(f"/proc/{pid}/task/{task}/children").read_text().split():
                with contextlib.suppress(OSError):
                    times = (
                        Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[11:15]
                    )
                    found += sum(map(float, times))
                found += _still_running(int(child))
    return found


def _shared(item: Any) -> Iterator[tuple[str, str]]:
    """Yield the fixtures that several tests share, by file and name."""
    for name, found in item._fixtureinfo.name2fixturedefs.items():
        if found and found[-1].scope in _SCOPES and found[-1].baseid:
            yield found[-1].baseid, name


def _is_of_few(item: pytest.Item) -> bool:
    """Whether a test is about none of the named arms, or about one of the few."""
    given = getattr(item, "callspec", None)
    params = {} if given is None else given.params
    case, names = params.get("case", params.get("arm")), {name for name, _ in FEW}
    if isinstance(case, tuple) and len(case) == 2 and all(isinstance(x, str) for x in case):
        return case in FEW
    named = {x for x in params.values() if isinstance(x, str) and x in NAMED_ARMS}
    return named <= names


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with the files that take longest, and leave out what is not wanted."""
    took = kept()
    if config.getoption("--arms") == "few":
        _leave_out(config, items, [item for item in items if not _is_of_few(item)])
    most = config.getoption("--below")
    if most is not None:
        _leave_out(config, items, _dearer(items, took, most))
    of_file = Counter[str]()
    for name, seconds in took.items():
        of_file[name.split("::")[0]] += seconds  # type: ignore[assignment]  # seconds
    # No worker is left alone with a long one at the end; the order within a file stays.
    items.sort(key=lambda item: -of_file[item.nodeid.split("::")[0]])


def _dearer(items: list[pytest.Item], took: dict[str, float], most: float) -> list[pytest.Item]:
    """Return the tests that take as much: of what several share, each that is left has its part."""
    out, left = list[pytest.Item](), [x for x in items if took.get(x.nodeid, 0.0) < most]
    out += [x for x in items if not took.get(x.nodeid, 0.0) < most]
    while True:
        users = Counter(key for item in left for key in _shared(item))

        def cost(item: pytest.Item, users: Counter[tuple[str, str]] = users) -> float:
            parts = (took.get("::".join(key), 0.0) / users[key] for key in _shared(item))
            return took.get(item.nodeid, 0.0) + sum(parts)

        more = [item for item in left if not cost(item) < most]
        if not more:
            return out
        out += more
        left = [item for item in left if cost(item) < most]


def _leave_out(
    config: pytest.Config, items: list[pytest.Item], unwanted: list[pytest.Item]
) -> None:
    out = set(map(id, unwanted))
    items[:] = [item for item in items if id(item) not in out]
    config.hook.pytest_deselected(items=unwanted)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any, request: Any) -> Generator[None, Any, Any]:
    """Note what a fixture that several tests share takes."""
    if not request.config.getoption("--keep-durations"):
        return (yield)
    began = _spent()
    found = yield
    if fixturedef.scope in _SCOPES:
        taken = request.config.stash.setdefault(_FIXTURES, {})
        name = f"{fixturedef.baseid}::{fixturedef.argname}"
        taken[name] = taken.get(name, 0.0) + _spent() - began
        request.node.config.stash[_IN_FIXTURES] = (
            request.config.stash.get(_IN_FIXTURES, 0.0) + _spent() - began
        )
    return found


_FIXTURES: Any = pytest.StashKey[dict[str, float]]()
_IN_FIXTURES: Any = pytest.StashKey[float]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Note what a test takes, without what it shares with others."""
    if item.config.getoption("--keep-durations"):
        item.stash[_BEGAN] = (_spent(), item.config.stash.get(_IN_FIXTURES, 0.0))
    return (yield)


_BEGAN: Any = pytest.StashKey[tuple[float, float]]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Generator[None, Any, Any]:
    """Let the report of a test's end carry what it took, to the process that writes."""
    report = yield
    if call.when == "teardown" and item.config.getoption("--keep-durations"):
        began, shared = item.stash[_BEGAN]
        stash = item.config.stash
        own = _spent() - began - (stash.get(_IN_FIXTURES, 0.0) - shared)
        report.took = {item.nodeid: own, **stash.get(_FIXTURES, {})}
        stash[_FIXTURES] = {}
    return report


_ALL: dict[str, float] = {}


def pytest_runtest_logreport(report: Any) -> None:
    """Gather what tests took."""
    for name, seconds in getattr(report, "took", {}).items():
        _ALL[name] = _ALL.get(name, 0.0) + seconds


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the list; of tests that were not run what is known of them stays."""
    config = session.config
    if not config.getoption("--keep-durations") or hasattr(config, "workerinput"):
        return
    ran = {name for name in _ALL}
    known = {name: seconds for name, seconds in kept().items() if name not in ran}
    listed = {name: seconds for name, seconds in {**known, **_ALL}.items() if seconds >= LEAST}
    with KEPT.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("name", "seconds"))
        for name in sorted(listed):
            writer.writerow((name, f"{listed[name]:.2f}"))
