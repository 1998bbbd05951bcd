"""The command line: where commands are registered, what shows how far they are, how they end."""

import math
import re
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)

import selfmotion as sm
from selfmotion.basics import seconds_waited_for_kernels, version
from selfmotion.planning.optimise import Iteration
from selfmotion.shell.cli import tables
from selfmotion.shell.cli.moved import replacement
from selfmotion.shell.cli.option_names import in_shell

if TYPE_CHECKING:
    from selfmotion.work.batch import BatchProgress

# Of shorter stages it is not said how long they will last [s].
_WORTH_SAYING = 2.0
# A log has a line at least this often [s], which is looked at in between.
_SILENT, _TICK = 10.0, 1.0
# Stages as callbacks receive them → in words, where they are not already.
_IN_WORDS = {
    "start": "optimising start",
    "branch": "looking for another branch of inverse kinematics, try",
    "posture": "trying posture",
    "part": "planning part",
    "fastest": "improving the pace, round",
    "seam": "planning seam",
    "other ways": "planning in other configurations, seam",
    "nearby": "planning in nearby configurations, seam",
    "program": "trying order",
    "feed": "trying feed",
    "move": "planning a move",
    "places": "trying place",
    "corners": "planning at corner",
    "margin": "planning with margin, round",
    "targets": "choosing targets of piece",
    "picture": "drawing picture",
    "refining": "refining the motion",
    "checking": "checking the motion",
    "warm start": "starting from the given plan",
}


class Display:
    """A bar on a terminal, gone when it ends; what a log shows instead is for who derives it.

    Parameters
    ----------
    console : Console
    columns : ProgressColumn
        Of the bar.
    """

    def __init__(self, console: Console, *columns: ProgressColumn) -> None:
        self._console = console
        # A log would get the bar once, when all is over.
        self._progress = Progress(
            *columns, console=console, transient=True, disable=not console.is_terminal
        )
        self._bar = self._progress.add_task("", total=None)

    def __enter__(self) -> Self:
        """Begin to show."""
        self._progress.start()
        return self

    def __exit__(self, *raised: object) -> None:
        """Leave the terminal as it was."""
        self._progress.stop()


class StageDisplay(Display):
    """Shows what `plan` tells: its `stage` is a progress callback, its `iteration` the other one.

    In a log a stage has a line where it begins, and one more every ten seconds that it lasts.

    Parameters
    ----------
    console : Console
    """

    def __init__(self, console: Console) -> None:
        super().__init__(
            console,
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TimeElapsedColumn(),
        )
        self._stage = self._about = self._cost = ""
        self._done = self._total = 0
        self._began = self._said = self._waited = 0.0
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        """Begin to show."""
        if not self._console.is_terminal:
            threading.Thread(target=self._keep_saying, daemon=True).start()
        return super().__enter__()

    def __exit__(self, *raised: object) -> None:
        """Leave the terminal as it was."""
        self._ended.set()
        super().__exit__(*raised)

    def stage(self, stage: str, done: int, total: int) -> None:
        """Show that number `done` of `total` in a stage has begun.

        Of 0 where it is not known how many there will be; number 0 of 0 is news that stay.
        """
        if total == done == 0:
            self._print(stage)
            return
        stage, quote, about = stage.partition(" '")
        is_new = stage != self._stage
        if is_new:
            self._stage, self._cost, self._began = stage, "", time.monotonic()
            self._waited = seconds_waited_for_kernels()
        self._about, self._done, self._total = quote + about, done, total
        if is_new and not self._console.is_terminal:
            self._print(self._line())
        self._progress.update(
            self._bar, completed=max(done - 1, 0), total=total if total > 1 else None
        )
        self._describe()

    def iteration(self, iteration: Iteration) -> None:
        """Show the cost so far."""
        self._cost = f", cost {iteration.cost:.6g}"
        self._describe()

    def _describe(self) -> None:
        self._progress.update(self._bar, description=self._line())

    def _line(self) -> str:
        """Return what is done, for how long, and for how much longer, in words."""
        several = self._total != 1
        count = (
            f" {max(self._done, 1)}{f' of {self._total}' if self._total else ''}" if several else ""
        )
        words = _IN_WORDS.get(self._stage, self._stage)
        return f"{words}{count}{self._about}{self._times()}{self._cost}"

    def _times(self) -> str:
        """Return how long a stage has taken, and how long it will if as long as before.

        Kernels are compiled once, however many there are.
        """
        spent = time.monotonic() - self._began
        left = 0.0
        if self._total > 1 and self._done > 1:
            working = max(spent - (seconds_waited_for_kernels() - self._waited), 0.0)
            left = working * (self._total - self._done + 1) / (self._done - 1)
        if spent + left <= _WORTH_SAYING:
            return ""
        return f", {spent:.0f} s so far{f', about {left:.0f} s to go' if left else ''}"

    def _print(self, text: str) -> None:
        self._said = time.monotonic()
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def _keep_saying(self) -> None:
        """Print a line where none was for a while, until all is over."""
        while not self._ended.wait(_TICK):
            if self._stage and time.monotonic() - max(self._said, self._began) >= _SILENT:
                self._print(self._line())


class BatchDisplay(Display):
    """A bar with rate and time left on a terminal, a line per tenth in a log."""

    def __init__(self, console: Console) -> None:
        super().__init__(console, TextColumn("{task.description}", markup=False), BarColumn())
        self._tenth = 0

    def show(self, found: "BatchProgress") -> None:
        """Show how far it is."""
        text = (
            f"{found.done} of {found.total} problems, {found.failed} without a plan, "
            f"{found.rate:.2f} per second, {found.seconds_left:.0f} s left"
        )
        self._progress.update(self._bar, description=text, completed=found.done, total=found.total)
        tenth = 10 * found.done // found.total
        if not self._console.is_terminal and tenth > self._tenth:
            self._console.print(text, markup=False)
        self._tenth = tenth


def check_cluster(address: str | None, workers: int | None) -> None:
    """Raise ProblemError where processes of this machine are asked for beside a cluster."""
    if address is not None and workers is not None:
        raise sm.errors.ProblemError("--workers has no effect beside --dask, whose workers plan")


@contextmanager
def executor_at(address: str | None) -> Iterator[Executor | None]:
    """Give the executor of a Dask cluster; None without an address.

    Raises
    ------
    ProblemError
        distributed is not installed, or no scheduler answers.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise sm.errors.ProblemError(
            "--dask needs the package distributed: pip install 'selfmotion[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise sm.errors.ProblemError(
            f"--dask: no scheduler answers at '{address}': {error}"
        ) from error
    with client:
        yield client.get_executor()


# Under which commands are listed.
PLAN, LOOK, FILES = "Plan", "Inspect plans", "Files"
LOOP, BEGIN = "While the arm moves", "To begin with"

app = typer.Typer(
    help="Plan the joint motion of a redundant arm along a tool motion.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"selfmotion {version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    pass


# What commands print, and apart from it, so that it can be piped, how far they are.
terminal = tables.console()
stages = Console(stderr=True, highlight=False)

VERIFIED, NOT_VERIFIED, BAD_INPUT, FAILED = 0, 1, 2, 3
# What shells expect of a command that Ctrl-C ended.
INTERRUPTED = 130


def main() -> None:
    """Run the command; exit code 2 and one line for bad input, 3 for a fault of ours.

    1 and a line where a deadline came before there was a motion, 130 and a line where it was
    stopped before there was anything to keep. With `--json` what is wrong is on the output as JSON
    as well, see `error_json`.
    """
    as_json = "--json" in sys.argv[1:]
    instead = replacement(sys.argv[1:])
    if instead:
        _fail(sm.errors.ProblemError(instead), instead, as_json)
        sys.exit(BAD_INPUT)
    try:
        code = app(standalone_mode=not as_json)
    except SystemExit as end:
        code = end.code
    except sm.SelfmotionError as error:
        _fail(error, in_shell(str(error)), as_json)
        # With more time there may be a motion: nothing is wrong with what was given.
        code = NOT_VERIFIED if isinstance(error, sm.errors.DeadlineError) else BAD_INPUT
    except typer.TyperException as error:
        # Of arguments and options themselves; it says so on its own where nothing is JSON.
        _fail(error, error.format_message(), as_json)
        code = BAD_INPUT
    except Exception as error:
        # Not bad input, and no verdict: whoever reads exit codes must not take it for one.
        traceback.print_exc()
        complain("selfmotion failed; this is a fault of the program, not of what it was given")
        if as_json:
            print_json(error_json(error, str(error)))
        code = FAILED
    if code == INTERRUPTED:
        complain("stopped before there was anything to keep")
    sys.exit(code)


def _fail(error: Exception, text: str, as_json: bool) -> None:
    complain(f"error: {text}")
    if as_json:
        print_json(error_json(error, text))


# How messages begin: with the file, then the key of a document, or a line or row of it.
_PLACE = re.compile(
    r"(?P<file>[^:\n]*[^\s:/]\.[A-Za-z]\w*): "
    r"(?:(?:line|row) (?P<line>\d+)\b|(?P<key>[A-Za-z_][\w.\[\]-]*): )?"
)


def error_json(error: Exception, text: str) -> dict[str, Any]:
    """Return an error as JSON has it.

    Its class and sentence; the file, key and line that the sentence begins with, null where it does
    not; and what the class has besides, such as the `time` of a BreakdownError.
    """
    found = _PLACE.match(text)
    place = {"file": None, "key": None, "line": None} | (found.groupdict() if found else {})
    if place["line"] is not None:
        place["line"] = int(place["line"])
    data = {"class": type(error).__name__, "message": text, **place}
    return {"error": {k: v for k, v in vars(error).items() if isinstance(v, _PLAIN)} | data}


# Attributes of errors that JSON has.
_PLAIN = (str, int, float, bool, type(None))


def print_json(data: Any) -> None:
    """Print values as JSON, which has no infinite numbers: they are null."""
    terminal.print_json(data=_finite(data), allow_nan=False)


def print_written(files: Sequence[Path], as_json: bool = False) -> None:
    """Print which files were written."""
    if as_json:
        print_json({"written": [str(file) for file in files]})
        return
    for file in files:
        terminal.print(f"wrote {file}", markup=False, soft_wrap=True)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value


def complain(text: str) -> None:
    """Print a line about what went wrong."""
    Console(stderr=True, highlight=False).print(text, style="red", markup=False, soft_wrap=True)


def plan_with_progress(problem: sm.Problem, **options: Any) -> sm.Plan:
    """Plan, and show how far it is."""
    with StageDisplay(stages) as display:
        return sm.plan(problem, callback=display.iteration, progress=display.stage, **options)


def fastest_with_progress(job: sm.files.PlanRequest, **options: Any) -> sm.Fastest:
    """Look for the fastest motion of a job, and show how far it is."""
    with StageDisplay(stages) as display:
        return job.fastest(progress=display.stage, **options)
