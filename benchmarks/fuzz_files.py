"""Reads 20,000 spoiled files through the public readers: `make bench NAME=fuzz-files`.

URDFs, SRDFs, paths, motions, problems, plans, limits and obstacles that were right once: bytes
flipped, cut, doubled, in other encodings, with numbers that cannot be meant, nested without end,
and announcing more than they hold. Each has to end in a value, or in a typed error of one line that
names the file; in 2 s of a processor and 500 MB beyond what the process has.
"""

from __future__ import annotations

import contextlib
import multiprocessing as mp
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from support.generated import Hang, alarm
from support.mutations import good_files, mutated

SECONDS, MEGABYTES = 2, 500
# What no signal of the process's own ends, ends after so many seconds on the clock.
_PATIENCE = 60.0


class End(NamedTuple):
    """How one file ended: what it is of, how, why, and what it took."""

    number: int
    what: str
    kind: str
    text: str
    seconds: float
    megabytes: float

    @property
    def is_wrong(self) -> bool:
        """Whether this must not be."""
        return self.kind not in ("read", "refused")


def end_of(number: int, seed: int, folder: Path) -> End:
    """Spoil a file, read it, and tell."""
    rng = np.random.default_rng([seed, number])
    goods = good_files()
    good = goods[number % len(goods)]
    file = folder / f"given{number}{good.suffix}"
    file.write_bytes(mutated(good, rng))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began, text = time.process_time(), ""
    try:
        with alarm(SECONDS), limited(MEGABYTES):
            good.read(file)
        kind = "read"
    except sm.SelfmotionError as error:
        kind, text = "refused", f"{type(error).__name__}: {error}"
        if file.name not in text:
            kind = "UNNAMED"
        elif "\n" in text or len(text) > 2000:
            kind = "LONG"
    except Hang:
        kind, text = "HANG", f"no end after {SECONDS} s"
    except MemoryError as error:
        kind, text = "MEMORY", repr(error)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        kind, text = "UNTYPED", f"{last.filename}:{last.lineno}: {error!r}"[:500]
    seconds = time.process_time() - began
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - grown
    if kind in ("read", "refused"):
        file.unlink()
    return End(number, f"{good.kind} {good.suffix}", kind, text, seconds, grown / 1024.0)


@contextlib.contextmanager
def limited(megabytes: int):
    """Let this process have so many megabytes more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + (megabytes << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)


def _work(numbers: Sequence[int], seed: int, folder: Path, out: Connection) -> None:
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115  # for as long as the process lives
    for good in good_files():  # compiles and imports what reading needs
        file = folder / f"good{good.suffix}"
        file.write_bytes(good.content)
        good.read(file)
    out.send(None)
    for number in numbers:
        out.send(end_of(number, seed, folder))
    out.close()


def read_all(numbers: Sequence[int], seed: int, folder: Path, told: Console) -> list[End]:
    """Read the files in a process of their own, and in another one after a crash."""
    context, ends = mp.get_context("spawn"), list[End]()
    while numbers:
        receiver, sender = context.Pipe(duplex=False)
        worker = context.Process(target=_work, args=(numbers, seed, folder, sender))
        worker.start()
        sender.close()
        why = ""
        receiver.recv()  # EOFError where good files cannot be read
        with contextlib.suppress(EOFError):
            while not why:
                if receiver.poll(_PATIENCE):
                    ends.append(receiver.recv())
                    numbers = numbers[1:]
                    _tell(ends[-1], told)
                else:
                    why = f"no end after {_PATIENCE:.0f} s on the clock"
        if why:
            os.kill(worker.pid or 0, signal.SIGKILL)
        worker.join()
        if numbers:
            kind = "HANG" if why else "CRASH"
            what = good_files()[numbers[0] % len(good_files())]
            text = why or f"the process ended with {worker.exitcode}"
            ends.append(End(numbers[0], f"{what.kind} {what.suffix}", kind, text, _PATIENCE, 0.0))
            _tell(ends[-1], told)
            numbers = numbers[1:]
    return ends


def _tell(end: End, told: Console) -> None:
    if end.is_wrong:
        told.print(f"{end.number} {end.what} {end.kind}: {end.text}", markup=False, soft_wrap=True)


def main(
    count: Annotated[int, typer.Option(help="How many files.")] = 20_000,
    first: Annotated[int, typer.Option(help="Number of the first one.")] = 0,
    seed: Annotated[int, typer.Option(help="Of all of them.")] = 0,
    kind: Annotated[str, typer.Option(help="Only files of these kinds, by comma.")] = "",
    out: Annotated[Path | None, typer.Option(help="Folder that keeps what went wrong.")] = None,
) -> None:
    """Spoil, read, and tell what is wrong."""
    console = Console()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) if out is None else out
        folder.mkdir(parents=True, exist_ok=True)
        numbers = range(first, first + count)
        if kind:
            goods, asked = good_files(), kind.split(",")
            chosen = [k for k, good in enumerate(goods) if good.kind in asked]
            # Of each lap through all kinds, those that were asked for.
            numbers = [first + len(goods) * (n // len(chosen)) + chosen[n % len(chosen)]
                       for n in range(count)]  # fmt: skip
        ends = read_all(numbers, seed, folder, console)
    for what in sorted({end.what for end in ends}):
        kinds = Counter(end.kind for end in ends if end.what == what)
        console.print(f"{what}: {dict(kinds)}", markup=False)
    kinds = Counter(end.kind for end in ends)
    console.print(
        f"{len(ends)} files: {dict(kinds)}; {max(end.seconds for end in ends):.2f} s and "
        f"{max(end.megabytes for end in ends):.0f} MB more at most",
        markup=False,
    )
    sys.exit(1 if any(end.is_wrong for end in ends) else 0)


if __name__ == "__main__":
    typer.run(main)
