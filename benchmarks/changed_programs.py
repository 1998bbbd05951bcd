"""Programs that somebody changed in one way: none that runs otherwise is verified.

Part of `make bench NAME=fuzz-programs`. Plans and jobs of arms of six axes are written for KUKA,
ABB and Universal Robots, as joint targets, as poses, at times or at their feed. One thing is
changed in each file: a target deleted, doubled or moved, a zone, a blend, a speed, an acceleration,
an output, the tool, the work object, a time, a unit, the order of two lines, or a line is put in
that no writer writes. `selfmotion check` judges the file; where it says verified, a player that
shares no code with the package (`tests/support/played_changes.py`) has to find that it runs as the
file stated when it was written. As they are written, none may be refused.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from selfmotion.model.task import SE3, exp3
from support.industrial import industrial_arm, two_seams
from support.played_changes import Player
from support.shell import invoke

NUMBER = r"-?\d+\.\d+"
SIGNALS = {
    ".src": {"arc on": (7, True), "arc off": (7, False)},
    ".script": {"arc on": (7, True), "arc off": (7, False)},
    ".mod": {"arc on": ("doArc", True), "arc off": ("doArc", False)},
}
KINDS = {
    ".src": ("joints", "poses", "timed-poses"),
    ".mod": ("joints", "poses", "timed-poses"),
    ".script": ("poses", "timed-poses"),
}
# Lines that no writer writes, and that move something, or hold it back.
STRANGE = {
    ".src": (
        "$OV_PRO = 10",
        "$ACC.CP = 0.1",
        "LIN_REL {X 5}",
        "$BASE = $NULLFRAME",
        "HALT",
        "PTP_REL {A1 2}",
        "$VEL_AXIS[1] = 5",
        "BAS(#TOOL, 2)",
        "$APO.CDIS = 30",
    ),
    ".mod": (
        "VelSet 10, 100;",
        "AccSet 20, 20;",
        "ConfL \\On;",
        "PDispOn \\Rot, p1;",
        "Stop;",
        "SingArea \\Wrist;",
        "MoveL Offs(p1, 0, 0, 5), v100, z10, tool0;",
        "EOffsSet e;",
    ),
    ".script": (
        "set_tcp(p[0, 0, 0.1, 0, 0, 0])",
        "stopl(1.0)",
        "movel(p[0, 0, 0, 0, 0, 0])",
        "speedl([0, 0, 0.1, 0, 0, 0], 0.5, 1)",
        "set_gravity([0, 9.81, 0])",
        "halt",
        "set_payload(5, [0, 0, 0.1])",
        "force_mode_set_damping(0.5)",
    ),
}


class Written(NamedTuple):
    """A program as it was written, what it is of, and who plays it."""

    name: str
    text: str
    suffix: str
    kept: Path
    player: Player


def _is_move(line: str) -> bool:
    return bool(re.match(r"\s*(SPTP|SPL|SLIN|SCIRC|Move[LC]|MoveAbsJ|move[ljc])\b", line))


def _pick(lines: list[str], rng: np.random.Generator, wanted: Callable[[str], bool]) -> int | None:
    found = [k for k, line in enumerate(lines) if wanted(line)]
    return int(rng.choice(found)) if found else None


def _number_changed(line: str, rng: np.random.Generator, change: Callable[[float], float]) -> str:
    spots = list(re.finditer(NUMBER, line))
    if not spots:
        return line
    spot = spots[int(rng.integers(len(spots)))]
    return f"{line[: spot.start()]}{change(float(spot[0])):.6f}{line[spot.end() :]}"


def deleted(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Delete a target; of KRL with its time, which goes to the next one in half of the cases."""
    k = _pick(lines, rng, _is_move)
    if k is None:
        return None
    if "SPTP" in lines[k] or "TIME_BLOCK PART" in (lines[k + 1] if k + 1 < len(lines) else ""):
        part = float(lines[k + 1].split("=")[1])
        rest = lines[:k] + lines[k + 2 :]
        nearest = next((j for j in range(k, len(rest)) if "TIME_BLOCK PART" in rest[j]), None)
        if rng.integers(2) and nearest is not None:
            other = float(rest[nearest].split("=")[1])
            rest[nearest] = f"    TIME_BLOCK PART = {part + other:.5f}"
        return rest
    seconds = re.search(r"(\\T:=|t=)([\d.]+)", lines[k])
    rest = lines[:k] + lines[k + 1 :]
    nearest = next((j for j in range(k, len(rest)) if re.search(r"(\\T:=|\bt=)", rest[j])), None)
    if seconds and rng.integers(2) and nearest is not None:
        rest[nearest] = re.sub(
            r"(\\T:=|\bt=)([\d.]+)",
            lambda found: f"{found[1]}{float(found[2]) + float(seconds[2]):.5f}",
            rest[nearest],
            count=1,
        )
    return rest


def doubled(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    k = _pick(lines, rng, _is_move)
    return None if k is None else [*lines[: k + 1], *lines[k:]]


def moved(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Move a target by 0.1 to 10 mm, degrees, or the like."""
    k = _pick(lines, rng, _is_move)
    if k is None:
        return None
    by = float(10.0 ** rng.uniform(-1.0, 1.0)) * float(rng.choice([-1.0, 1.0]))
    by *= 1e-3 if "move" in lines[k][:8] else 1.0
    return [*lines[:k], _number_changed(lines[k], rng, lambda x: x + by), *lines[k + 1 :]]


def zoned(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Change a zone or a blend, or all of them."""
    zone = str(rng.choice(["z0", "z5", "z50", "z200", "fine"]))
    radius = float(10.0 ** rng.uniform(-4.5, 0.0)) * float(rng.integers(4) > 0)

    def change(line: str) -> str:
        line = re.sub(r", (z\d+|fine), ", f", {zone}, ", line)
        return re.sub(r"r=[\d.]+", f"r={radius:.6f}", line)

    def has_zone(line: str) -> bool:
        return change(line) != line

    k = _pick(lines, rng, has_zone)
    if k is None:
        return None
    if rng.integers(2):
        return [*lines[:k], change(lines[k]), *lines[k + 1 :]]
    return [change(line) if "_v, fine" not in line else line for line in lines]


def sped(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Change a speed or an acceleration that is stated anywhere."""
    factor = float(rng.choice([0.01, 0.5, 0.9, 1.1, 2.0, 50.0]))
    pattern = r"(\$VEL\.\w+ = |_PTP, |v=|a=|speeddata \w+ := \[)([\d.]+)"
    k = _pick(lines, rng, lambda line: bool(re.search(pattern, line)))
    if k is None:
        return None

    def change(found: re.Match[str]) -> str:
        return f"{found[1]}{factor * float(found[2]):g}"

    return [*lines[:k], re.sub(pattern, change, lines[k], count=1), *lines[k + 1 :]]


def held_back(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Put in a line that the writer has elsewhere, and that holds motions back."""
    k = _pick(lines, rng, lambda line: bool(re.match(r"\s*(PTP_SPLINE|SPLINE)", line)))
    if k is None:
        return None
    slow = rng.choice(
        ["  BAS(#VEL_PTP, 5)", "  BAS(#ACC_PTP, 30)", "  $VEL.CP = 0.01", "  $VEL.ORI1 = 0.5"]
    )
    return [*lines[:k], str(slow), *lines[k:]]


def switched(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Change an output: its value, its number, or that of all; delete it, or put another one in."""
    pattern = r"\$OUT\[|SetDO|set_standard_digital_out"
    k = _pick(lines, rng, lambda line: bool(re.search(pattern, line)))
    way = int(rng.integers(5))
    swap = {"TRUE": "FALSE", "FALSE": "TRUE", "True": "False", "False": "True"}

    def flipped(line: str) -> str:
        line = re.sub(r"\b(TRUE|FALSE|True|False)\b", lambda found: swap[found[0]], line)
        return re.sub(r"(SetDO \w+, )([01])", lambda f: f"{f[1]}{1 - int(f[2])}", line)

    def elsewhere(line: str) -> str:
        return line.replace("[7]", "[1]").replace("out(7", "out(1").replace("doArc", "doGas")

    if k is None:
        return None
    match way:
        case 0:
            return [*lines[:k], flipped(lines[k]), *lines[k + 1 :]]
        case 1:
            return [flipped(line) for line in lines]
        case 2:
            return [elsewhere(line) if re.search(pattern, line) else line for line in lines]
        case 3:
            return lines[:k] + lines[k + 1 :]
    return [*lines[:k], flipped(lines[k]), *lines[k:]]


def framed(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Change a number of the tool or the work object."""
    pattern = r"\$TOOL|\$BASE|tooldata|wobjdata|set_tcp|feature ="
    k = _pick(lines, rng, lambda line: bool(re.search(pattern, line)))
    by = float(rng.choice([-1.0, 1.0])) * float(10.0 ** rng.uniform(-1.0, 1.0))
    if k is None:
        return None
    by *= 1e-3 if "p[" in lines[k] else 1.0
    return [*lines[:k], _number_changed(lines[k], rng, lambda x: x + by), *lines[k + 1 :]]


def timed(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Change a time: of a motion, a wait, or a whole block."""
    pattern = r"(TIME_BLOCK \w+ = |\\T:=|\bt=|WAIT SEC |WaitTime |sleep\(|planned time: )([\d.]+)"
    factor = float(rng.choice([0.2, 0.9, 0.99, 1.01, 1.1, 5.0]))
    k = _pick(lines, rng, lambda line: bool(re.search(pattern, line)))
    if k is None:
        return None

    def change(found: re.Match[str]) -> str:
        return f"{found[1]}{factor * float(found[2]):.5f}"

    return [*lines[:k], re.sub(pattern, change, lines[k], count=1), *lines[k + 1 :]]


def unit(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Take a number for one in another unit."""
    k = _pick(lines, rng, _is_move)
    factor = float(rng.choice([1e-3, 1e3, np.pi / 180.0, 180.0 / np.pi, 25.4]))
    if k is None:
        return None
    return [*lines[:k], _number_changed(lines[k], rng, lambda x: factor * x), *lines[k + 1 :]]


def exchanged(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Exchange two lines that follow each other."""
    body = [k for k in range(len(lines) - 1) if _is_code(lines[k]) and _is_code(lines[k + 1])]
    k = int(rng.choice(body))
    return [*lines[:k], lines[k + 1], lines[k], *lines[k + 2 :]]


def _is_code(line: str) -> bool:
    return bool(line.strip()) and line.strip()[0] not in ";!#&"


def stranger(lines: list[str], rng: np.random.Generator) -> list[str] | None:
    """Put in a line that no writer writes."""
    suffix = ".mod" if "MODULE" in lines[0] else ".src" if "&ACCESS" in lines[0] else ".script"
    k = _pick(lines, rng, _is_move)
    return None if k is None else [*lines[:k], f"  {rng.choice(STRANGE[suffix])}", *lines[k:]]


CHANGES = (
    *(deleted, doubled, moved, zoned, sped, held_back, switched, framed, timed, unit),
    *(exchanged, stranger),
)


def made(folder: Path) -> Iterator[tuple[str, sm.Plan | sm.Program, str]]:
    """Yield plans and a job, and the link that their poses are counted in."""
    rng = np.random.default_rng(7)
    yield "job", two_seams(), "base"
    for maker in ("abb", "kuka"):
        arm = industrial_arm(folder, maker)
        start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
        first = arm.pose(start)
        side = rng.normal(size=3)
        side /= np.linalg.norm(side)
        turned = SE3(
            first.rotation @ exp3(0.2 * rng.normal(size=3)), first.translation + 0.06 * side
        )
        line = sm.paths.Line(first, turned, 1.5)
        circle = sm.paths.Circle.around(first, 0.04, 2.0, normal=side, turns=0.5)
        for name, path in (
            (f"{maker}, line", line),
            (f"{maker}, arc at a feed", sm.paths.Feed(circle, 0.05)),
        ):
            problem = sm.Problem(arm, path, "pointing", start, clearance=None)
            yield name, sm.plan(problem).require(), "world_frame"


def programs(folder: Path) -> Iterator[Written]:
    """Yield all programs as they are written, judged and played."""
    for number, (name, plan, carrier) in enumerate(made(folder)):
        kept = folder / f"{number}{'.npz' if isinstance(plan, sm.Plan) else '.program'}"
        plan.save(kept)
        for suffix, kinds in KINDS.items():
            for targets in kinds:
                file = folder / f"written_{number}_{targets.replace('-', '_')}{suffix}"
                settings = sm.files.ProgramSettings(
                    mass=2.0,
                    targets=targets,
                    signals=SIGNALS[suffix] if name == "job" else None,
                )
                sm.files.write_motion(plan, file, settings=settings)
                player = Player(plan, file, carrier, plan.robot.tool)
                yield Written(f"{name}, {targets}", file.read_text(), suffix, kept, player)


def main(
    number: Annotated[int, typer.Option(help="How many changed programs.")] = 1000,
    seed: Annotated[int, typer.Option(help="Of the changes.")] = 0,
) -> None:
    """Judge changed programs, and print a table; exit 1 where one that is verified is not so."""
    console, begin = Console(width=130), time.perf_counter()
    refused, false, counts = list[str](), list[str](), dict[str, Counter[str]]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        every = list(programs(folder))
        for item in every:
            file = folder / f"weld{item.suffix}"
            file.write_text(item.text)
            code, told = judged(file, item.kept)
            wrong = item.player.beyond(file)
            if code or wrong:
                refused.append(f"{item.name}{item.suffix}: {told}; {wrong}")
        for k in range(number):
            rng = np.random.default_rng((seed, k))
            item, change = every[k % len(every)], CHANGES[int(rng.integers(len(CHANGES)))]
            lines = change(item.text.splitlines(), rng)
            text = item.text if lines is None else "\n".join([*lines, ""])
            told = counts.setdefault(change.__name__, Counter())
            if text == item.text:
                told["not there"] += 1
                continue
            file = folder / f"weld{item.suffix}"
            file.write_text(text)
            code, said = judged(file, item.kept)
            told[("verified", "not verified", "refused")[code]] += 1
            wrong = item.player.beyond(file) if code < 2 else []
            told["confirmed"] += code == 1 and bool(wrong)
            if code == 0 and wrong:
                told["FALSE"] += 1
                false.append(f"{k}: {item.name}{item.suffix}, {change.__name__}: {wrong[:2]}")
            if code > 2 or (code == 2 and not said.startswith("error: ")):
                false.append(f"{k}: {item.name}{item.suffix}, {change.__name__}: ends with {code}")
    # Of what is not verified, so much runs otherwise by the player as well.
    heads = ("verified", "not verified", "confirmed", "refused", "not there", "FALSE")
    table = Table("changed", *heads)
    for name, told in sorted(counts.items()):
        table.add_row(name, *(str(told[head]) for head in heads))
    console.print(table)
    for line in (*refused, *false):
        console.print(line)
    console.print(
        f"{number} changed programs, {len(false)} verified that run otherwise; of {len(every)} as "
        f"written {len(refused)} refused; {time.perf_counter() - begin:.0f} s"
    )
    raise SystemExit(1 if refused or false else 0)


def judged(file: Path, kept: Path) -> tuple[int, str]:
    """Return the exit code of the check, and what it says last."""
    try:
        code, printed = invoke("check", file, "--robot", kept)
    except sm.SelfmotionError as error:
        return 2, f"error: {error}"
    return code, (printed.strip().splitlines() or [""])[-1][:200]


if __name__ == "__main__":
    typer.run(main)
