"""Puts faults into the parts that all else stands on, and counts those that tests catch.

`make bench NAME=mutants`: a sample, by a seed, of the mutants that cosmic-ray's operators make of
what plans (charts, rows, objective, Newton's method, ends, search, virtual joints, bodies), of what
judges, and of places and readers. Each is judged by the tests of its part, in a process of its own,
the cheapest first, until one fails. Survivors are told with what was changed. Those that change no
result are listed in data/equivalent_mutants.toml with the reason, and are not counted.

Left out, because every test or none would see them: decorators, annotations, what is called only in
order to be compiled (`meanwhile`), and replacements that nobody writes for numbers (bits, shifts,
remainders, identity).
"""

from __future__ import annotations

import ast
import importlib
import importlib.abc
import importlib.machinery
import inspect
import math
import os
import random
import resource
import shlex
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Annotated, Any, NamedTuple, NoReturn

import numba
import pytest
import typer
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from numba.core.caching import FunctionCache
from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
SOURCE = HERE.parent / "src" / "selfmotion"
TESTS = HERE.parent / "tests"
EQUIVALENT = HERE / "data" / "equivalent_mutants.toml"
# How long tests may take of the processor: this, what compiles anew where a kernel is at fault, and
# so many times what they take of the code as it is [s]; and how many times that by the clock, which
# other work may slow down.
PATIENCE, COMPILING, TIMES, BUSY = 10.0, 120.0, 5.0, 10.0

_BINARY = (
    *("Add_Sub", "Add_Mul", "Sub_Add", "Sub_Mul", "Mul_Add", "Mul_Div", "Div_Mul", "Div_Sub"),
    *("Pow_Mul", "Mod_Add", "FloorDiv_Mul", "BitAnd_BitOr", "BitOr_BitAnd"),
)
_COMPARISONS = (
    *("Lt_LtE", "Lt_GtE", "LtE_Lt", "LtE_Gt", "Gt_GtE", "Gt_LtE", "GtE_Gt", "GtE_Lt"),
    *("Eq_NotEq", "NotEq_Eq", "Is_IsNot", "IsNot_Is"),
)
OPERATORS = {
    f"core/{name}"
    for name in (
        *("AddNot", "ReplaceAndWithOr", "ReplaceOrWithAnd", "NumberReplacer", "ExceptionReplacer"),
        *("ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ZeroIterationForLoop"),
        *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak"),
        *(f"ReplaceUnaryOperator_Delete_{what}" for what in ("Not", "USub", "Invert")),
        *(f"ReplaceBinaryOperator_{what}" for what in _BINARY),
        *(f"ReplaceComparisonOperator_{what}" for what in _COMPARISONS),
    )
}


class Part(NamedTuple):
    """What is mutated, and the tests that judge it: arguments of pytest, the cheapest first.

    Where its `own_first` are quick, the tests of a module come before all others.
    """

    name: str
    files: tuple[str, ...]
    tests: tuple[str, ...]
    compiled: bool = True
    own_first: bool = False

    def tests_of(self, mutant: Mutant) -> tuple[str, ...]:
        """Return the tests that judge a mutant, in order."""
        file = Path(mutant.file)
        own = f"{file.parent.name}/test_{file.name}"
        return (own, *self.tests) if self.own_first and (TESTS / own).is_file() else self.tests


# Laws that are checked on many arms are checked on three of them.
PARTS = (
    Part(
        "charts",
        ("planning/nodes/charts.py", "planning/nodes/motion.py", "planning/nodes/spline.py"),
        (
            *("nodes/test_spline.py", "nodes/test_charts.py", "nodes/test_motion.py"),
            *("nodes/test_objective.py", "nodes/test_newton.py"),
        ),
    ),
    Part(
        "rows",
        (
            "planning/nodes/rows.py",
            "planning/nodes/limit_rows.py",
            "planning/nodes/limit_kernels.py",
            "problem/constraints/conditions.py",
        ),
        (
            "nodes/test_rows.py",
            "constraints/test_conditions.py",
            "constraints/test_base.py -k 'equality or finite or rows'",
            "nodes/test_newton.py",
            "constraints/test_limits.py",
        ),
    ),
    Part(
        "objective",
        (
            "planning/nodes/objective.py",
            "planning/nodes/quadratic.py",
            "planning/nodes/smoothness.py",
        ),
        ("nodes/test_objective.py", "nodes/test_smoothness.py", "nodes/test_newton.py"),
    ),
    Part(
        "newton",
        (
            "planning/nodes/newton.py",
            "planning/nodes/newton_kernels.py",
            "planning/nodes/newton_system.py",
            "planning/nodes/settings.py",
            "planning/nodes/batch.py",
        ),
        (
            "nodes/test_newton_steps.py",
            "nodes/test_batch.py",
            "nodes/test_newton.py",
            "constraints/test_limits.py",
            "planning/test_beginnings.py",
        ),
    ),
    Part(
        "ends",
        ("planning/nodes/ends.py", "problem/constraints/ends.py"),
        ("nodes/test_ends.py", "constraints/test_ends.py"),
    ),
    Part(
        "search",
        ("planning/search/*.py",),
        ("search", "planning/test_starts.py"),
        own_first=True,
    ),
    Part(
        "virtual joints",
        (
            "model/follow/virtual_joints.py",
            "model/follow/relaxed.py",
            "model/follow/coordinates.py",
            "planning/formulation/tolerances.py",
        ),
        ("follow/test_virtual_joints.py", "planning/test_relaxations.py"),
    ),
    Part(
        "collision",
        ("model/collision/*.py",),
        ("collision",),
        own_first=True,
    ),
    Part(
        "optimiser",
        ("planning/optimise/*.py",),
        ("optimise",),
        own_first=True,
    ),
    Part(
        "certificate",
        ("certificate/*.py",),
        (
            "constraints/test_limits.py -k 'judged or whole_turns'",
            "certificate/test_made_to_deceive.py",
            "constraints/test_position_dependent.py",
            "whole/test_verdicts.py -k 'not threads'",
            "certificate -k 'not default and not deception'",
        ),
        own_first=True,
    ),
    Part(
        "bounds",
        (
            "basics/series.py",
            "model/robot/chain_series.py",
            "model/robot/tool_rates.py",
            "model/motion/spline.py",
        ),
        (
            "basics/test_series.py",
            "robot/test_chain_series.py",
            "motion/test_polynomials.py",
            "motion/test_spline.py",
            "path/test_series.py",
            "certificate/test_bounds_hold.py",
            "certificate/test_made_to_deceive.py",
            "certificate/test_bounding.py",
        ),
    ),
    Part(
        "placement",
        ("work/placement/*.py",),
        (
            *("placement/test_search.py", "placement/test_picture.py", "placement/test_results.py"),
            *("placement/test_patience.py", "placement/test_places.py", "placement/test_place.py"),
            *("placement/test_with_margin.py", "placement/test_correction_range.py"),
            "placement/test_correction.py",
        ),
        own_first=True,
    ),
    Part(
        "programs read",
        (
            "shop/controllers/*_reader.py",
            "shop/controllers/program_comments.py",
            "shop/controllers/program_lines.py",
            "shop/controllers/statements.py",
        ),
        (
            "controllers/test_program_lines.py",
            "controllers/test_program_reader.py",
            "controllers/test_statements.py",
            "controllers/test_programs.py",
            "controllers/test_feed_programs.py -k 'touched_up or another or acceleration or "
            "straight_seam or full_turn or feeds_that_change or never_reached'",
            "controllers/test_what_runs.py",
            "controllers/test_pose_programs.py",
            "controllers/test_feed_programs.py",
        ),
    ),
    Part(
        "cam",
        ("shop/cam/*.py",),
        (
            "cam",
            "documents/test_cases.py -k 'not (limit or telescope or srdf or xacro or retimed or "
            "planar or plane or five_joints or tolerance or meshes or overlap or collision)'",
        ),
        own_first=True,
    ),
)


class Mutant(NamedTuple):
    """One fault: where, by which operator, and the line before and after."""

    part: str
    file: str
    operator: str
    line: int
    before: str
    after: str
    source: str

    @property
    def module(self) -> str:
        """The name of its module."""
        return "selfmotion." + self.file.removesuffix(".py").replace("/", ".")

    @property
    def compiles(self) -> bool:
        """Whether there are kernels in its file."""
        return any(f"\n@{name}\n" in self.source for name in ("kernel", "called", "inlined"))


def sample_of(part: Part, count: int, seed: int) -> tuple[list[Mutant], int]:
    """Return `count` mutants of a part, by a seed, and how many there are in all."""
    places = [
        (file, name, occurrence)
        for file in sorted(file for pattern in part.files for file in SOURCE.glob(pattern))
        for name, occurrence in _places(file.read_text())
    ]
    for pattern in part.files:
        if not any(SOURCE.glob(pattern)):
            sys.exit(f"part '{part.name}': no file is {pattern}")
    chosen = random.Random(f"{part.name} {seed}").sample(places, min(count, len(places)))
    return [_mutant(part, *place) for place in chosen], len(places)


def _places(text: str) -> Iterator[tuple[str, int]]:
    """Return what operators can do to a file: their names, and the number of the place."""
    nodes, noise = list(ast_nodes(get_ast(text))), _noise(text)
    for name in sorted(OPERATORS & set(operator_names())):
        operator = get_operator(name)()
        places = (start for node in nodes for start, _ in operator.mutation_positions(node))
        for occurrence, start in enumerate(places):
            if not any(first <= start < last for first, last in noise):
                yield name, occurrence


def _noise(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return where decorators, annotations, stars between parameters and calls of kernels are."""
    found: list[ast.AST] = []
    for node in ast.walk(ast.parse(text)):
        decorators = getattr(node, "decorator_list", [])
        found += decorators
        if any(ast.unparse(x) == "meanwhile" for x in decorators):
            found.append(node)
        found += [
            x for x in (getattr(node, "annotation", None), getattr(node, "returns", None)) if x
        ]
    lines = list(enumerate(text.splitlines(), start=1))
    stars = [((k, 0), (k, len(line))) for k, line in lines if line.strip() == "*,"]
    return [((x.lineno, x.col_offset), (x.end_lineno, x.end_col_offset)) for x in found] + stars


def _mutant(part: Part, file: Path, operator: str, occurrence: int) -> Mutant:
    text = file.read_text()
    source = str(mutate_code(text, get_operator(operator)(), occurrence))
    pairs = list(zip(text.splitlines(), source.splitlines(), strict=False))
    row = next(k for k, (before, after) in enumerate(pairs) if before != after)
    before, after = (" ".join(line.split()) for line in pairs[row])
    name = file.relative_to(SOURCE).as_posix()
    return Mutant(part.name, name, operator.split("/")[1], row + 1, before, after, source)


class _Instead(importlib.abc.MetaPathFinder):
    """Imports a module of ours from another source than its file's."""

    def __init__(self, mutant: Mutant) -> None:
        self._file, self._source = SOURCE / mutant.file, mutant.source
        self._name = mutant.module

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name != self._name:
            return None
        loader = importlib.machinery.SourceFileLoader(name, str(self._file))
        # Without its time no compiled file is looked for, and none written.
        loader.path_stats = self._no_stats  # type: ignore[method-assign]
        loader.get_data = self._data  # type: ignore[method-assign]
        return spec_from_file_location(name, self._file, loader=loader)

    def _no_stats(self, path: str) -> Mapping[str, float]:
        raise OSError

    def _data(self, path: str) -> bytes:
        return self._source.encode()


def _compile_with(module: str) -> None:
    """Compile kernels anew that are of a module, or call what is; keep no kernel.

    Numba knows a kept one by its bytecode, without the numbers in it and what it calls.
    """
    load = FunctionCache.load_overload

    def load_others(cache: Any, *given: Any) -> Any:
        return None if _reaches(cache._py_func, module, set()) else load(cache, *given)

    FunctionCache.load_overload = load_others
    FunctionCache.save_overload = lambda *_: None


def _reaches(function: FunctionType, module: str, seen: set[FunctionType]) -> bool:
    """Return whether a function is of a module, or calls one that is."""
    if function.__module__ == module:
        return True
    seen.add(function)
    found = inspect.getclosurevars(function)
    used = [*found.globals.values(), *found.nonlocals.values()]
    used += [getattr(x, n, None) for x in used if isinstance(x, ModuleType) for n in found.unbound]
    called = {getattr(x, "py_func", x) for x in used if callable(x)}
    functions = {x for x in called if isinstance(x, FunctionType)} - seen
    return any(_reaches(x, module, seen) for x in functions)


def fails(part: Part, tests: str, mutant: Mutant | None, patience: float, log: Path) -> str:
    """Return why tests fail on a mutant, "" where they pass; in a process of their own."""
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(patience), resource.RLIM_INFINITY))
        _test(part, tests, mutant, log)
    ends = time.monotonic() + BUSY * patience
    while time.monotonic() < ends:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
                return "no end"
            return "" if status == 0 else "a test fails"
        time.sleep(0.01)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "no end"


def _test(part: Part, tests: str, mutant: Mutant | None, log: Path) -> NoReturn:
    """Run tests in this process, and end it."""
    os.setpgrp()
    with log.open("w") as out:
        os.dup2(out.fileno(), 1)
        os.dup2(out.fileno(), 2)
    if mutant is not None:
        sys.meta_path.insert(0, _Instead(mutant))
        _compile_with(mutant.module)
    given = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", f"--rootdir={TESTS.parent}"]
    given += ["--arms", "few"]
    if not part.compiled:
        # Kernels as they are written: faults compile slowly. NumPy's scalars warn, kernels do not.
        numba.config.DISABLE_JIT = True
        given += ["-W", "ignore::RuntimeWarning"]
    file, *options = shlex.split(tests)
    code = 1
    try:
        code = int(pytest.main([str(TESTS / file), *options, *given]))
    finally:
        sys.stdout.flush()
        os._exit(min(code, 127))


def equivalent() -> dict[tuple[str, str, str], str]:
    """Return the reasons of mutants that change no result, by file and line before and after."""
    entries = tomllib.loads(EQUIVALENT.read_text())["mutant"]
    return {(x["file"], x["before"], x["after"]): x["reason"] for x in entries}


def main(
    count: Annotated[int, typer.Option(help="Mutants of each part.")] = 40,
    seed: Annotated[int, typer.Option(help="Of the sample.")] = 0,
    part: Annotated[list[str] | None, typer.Option(help="Only these parts.")] = None,
) -> None:
    """Mutate, test, and tell what survives."""
    console = Console(soft_wrap=True, markup=False, highlight=False)
    stages = Console(stderr=True, highlight=False)
    parts, reasons = [x for x in PARTS if not part or x.name in part], equivalent()
    table = Table("part", "mutants", "sample", "caught", "survived", "equivalent", "score")
    totals, endless = Counter[str](), 0
    _warm()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        for one in parts:
            patience = {}
            for tests in one.tests:
                began = _computed()
                if fails(one, tests, None, 600.0, log):
                    sys.exit(f"{tests} fails on the code as it is:\n{log.read_text()}")
                patience[tests] = PATIENCE + TIMES * (_computed() - began)
            longest = max(patience.values())
            sample, of_all = sample_of(one, count, seed)
            ends = Counter[str]()
            for mutant in sample:
                reason = reasons.get((mutant.file, mutant.before, mutant.after))
                if reason is not None:
                    ends["equivalent"] += 1
                    continue
                more = COMPILING if mutant.compiles else 0.0
                reasons_to_fail = (
                    fails(one, x, mutant, patience.get(x, longest) + more, log)
                    for x in one.tests_of(mutant)
                )
                why = next(filter(None, reasons_to_fail), "")
                ends["caught" if why else "survived"] += 1
                endless += why == "no end"
                stages.print(f"{one.name}: {ends.total()} of {len(sample)}", end="\r")
                if not why:
                    console.print(f"{mutant.file}:{mutant.line} {mutant.operator}")
                    console.print(f"    - {mutant.before}\n    + {mutant.after}")
            table.add_row(*_row(one.name, of_all, ends))
            totals += ends + Counter(all=of_all)
    table.add_row(*_row("all", totals.pop("all"), totals))
    console.print(f"seed {seed}; {endless} of those caught found no end in time", table, sep="\n")


def _computed() -> float:
    """Return the seconds of the processor that all ended tests have taken."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def _row(name: str, of_all: int, ends: Counter[str]) -> list[str]:
    judged = ends["caught"] + ends["survived"]
    share = f"{100.0 * ends['caught'] / max(judged, 1):.0f} %"
    numbers = (of_all, ends.total(), ends["caught"], ends["survived"], ends["equivalent"])
    return [name, *map(str, numbers), share]


def _warm() -> None:
    """Import what others made once for all processes, and ours in each anew."""
    os.chdir(TESTS.parent)
    sys.path.insert(0, str(TESTS))
    for name in (
        "support.arms",
        "scipy.optimize",
        "scipy.interpolate",
        "daqp",
        "selfmotion.shell.testing",
    ):
        importlib.import_module(name)
    for name in [x for x in sys.modules if x.split(".")[0] in ("selfmotion", "support")]:
        del sys.modules[name]


if __name__ == "__main__":
    typer.run(main)
