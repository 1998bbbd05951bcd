"""Plans with the robot descriptions that people have: `make bench NAME=arms`.

Three lists: the makers' own repositories (makers.csv), the package robot_descriptions, and each
chain of two joints or more of example-robot-data. Of the first two, `selfmotion init FILE --tool
TOOL` has to write a problem that `selfmotion plan` verifies, and the tool has to stand where
yourdfpy has it; chains follow a line from where they move the tool well. What is not planned says
why in the words of the error. Writes docs/chains.md.

Repositories are cloned into out/descriptions; what is there already is not fetched again. Without a
network their rows say so.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import files, version
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import yourdfpy

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.robot import Packages, expand, is_xacro

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "chains.md"
CACHE = HERE.parent / "out" / "descriptions"
MAKERS, LIST, CHAINS = "makers' repositories", "robot_descriptions", "example-robot-data"
# A command that takes longer is ended [s].
_PATIENCE = 300.0
# Configurations at which the tool is looked at, and how far from yourdfpy's it may be [m, and of a
# rotation's elements].
_CONFIGURATIONS, _AGREE = 20, 1e-7
NOT_FETCHED = "not fetched"
# The line of chains [m, s], their tasks, and configurations that are tried where one overlaps.
_LENGTH, _DURATION = 0.02, 2.0
_TASKS = (sm.Task.POSE, sm.Task.POINTING, sm.Task.POSITION, sm.Task.PLANAR)
_TRIED = 100


@dataclass(frozen=True)
class Description:
    """A robot's file, or why there is none.

    Attributes
    ----------
    of : str
        Which list it is from.
    arm, source : str
        Whose it is, and where it is published.
    file, folder : path or None
        The file, and the folder with its packages; None where it was not fetched.
    more : tuple of path
        Further folders with packages.
    arguments : tuple of (str, str)
        Of a xacro file.
    why : str
        Why it was not fetched.
    """

    of: str
    arm: str
    source: str
    file: Path | None = None
    folder: Path | None = None
    more: tuple[Path, ...] = ()
    arguments: tuple[tuple[str, str], ...] = ()
    why: str = ""


@dataclass(frozen=True)
class Row:
    """One arm, and how far it came."""

    of: str
    arm: str
    source: str
    tool: str = ""
    joints: int = 0
    task: str = ""
    loaded: bool = False
    planned: bool = False
    verified: bool = False
    why: str = ""
    apart: float = field(default=0.0, compare=False)

    @property
    def is_fetched(self) -> bool:
        return not self.why.startswith(NOT_FETCHED)

    @property
    def is_wrong(self) -> bool:
        return self.why.startswith("UNTYPED")


# What there is.


def robots() -> Path:
    """Return the folder of the robots that example-robot-data installs."""
    for file in files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).resolve().parents[2]
    raise SystemExit("example-robot-data is not installed")


def of_chains() -> Iterator[Description]:
    """Yield all URDF files of example-robot-data, in one order."""
    for file in sorted(robots().rglob("*.urdf")):
        name = file.relative_to(robots()).as_posix()
        yield Description(CHAINS, file.stem, name, file, robots().parents[1])


def of_makers(cache: Path = CACHE, table: Path = HERE / "makers.csv") -> Iterator[Description]:
    """Yield the descriptions of makers.csv, whose repositories are cloned into a folder."""
    for row in csv.DictReader(table.read_text("utf-8").splitlines()):
        # Packages that it needs are in further repositories.
        repository, *more = row["repository"].split()
        arm, source = f"{row['maker']} {row['arm']}", f"{repository}, {row['file']}"
        given = [word.partition("=") for word in row["arguments"].split()]
        folder = cache / repository
        bare = Description(MAKERS, arm, source)
        if why := next(filter(None, (_cloned(name, cache) for name in (repository, *more))), ""):
            yield replace(bare, why=f"{NOT_FETCHED}: {why}")
            continue
        file = folder / row["file"]
        if not file.is_file():
            yield replace(bare, why=f"{NOT_FETCHED}: the repository has no such file now")
            continue
        at = _git("-C", folder, "rev-parse", "--short=8", "HEAD").stdout.strip()
        yield replace(
            bare,
            source=f"{repository} at {at}, {row['file']}",
            file=file,
            folder=folder,
            more=tuple(cache / name for name in more),
            arguments=tuple((key, value) for key, _, value in given),
        )


def _cloned(repository: str, cache: Path) -> str:
    """Clone a repository into a folder where it is not there; return why that failed, or ""."""
    folder = cache / repository
    if (folder / ".git").exists():
        return ""
    address = f"https://github.com/{repository}.git"
    done = _git("clone", "--quiet", "--depth", "1", address, folder)
    return _last_line(done.stderr) if done.returncode else ""


_ASKED = (
    "import contextlib, importlib, json, sys\n"
    "with contextlib.redirect_stdout(sys.stderr):\n"
    "    found = importlib.import_module('robot_descriptions.' + sys.argv[1])\n"
    "names = ('URDF_PATH', 'XACRO_PATH', 'XACRO_ARGS', 'XACRO_PACKAGE_PATHS', 'REPOSITORY_PATH')\n"
    "print(json.dumps({name: getattr(found, name, None) for name in names}))\n"
)


def of_list() -> Iterator[Description]:
    """Yield the URDFs of robot_descriptions, which clones what it lacks when it is imported."""
    from robot_descriptions._descriptions import DESCRIPTIONS
    from robot_descriptions._repositories import REPOSITORIES

    for name, known in sorted(DESCRIPTIONS.items()):
        if not known.has_urdf:
            continue
        arm = " ".join(word for word in (known.maker, known.robot) if word)
        bare = Description(LIST, arm, name)
        found, why = _imported(name, {})
        if found is None:
            # The revision that the package pins may be gone: the newest one is taken.
            asked = _git("ls-remote", REPOSITORIES[known.repository].url, "HEAD")
            newest = asked.stdout.split()[:1]
            if newest:
                found, why = _imported(name, {"ROBOT_DESCRIPTION_COMMIT": newest[0]})
        if found is None:
            yield replace(bare, why=f"{NOT_FETCHED}: {why}")
            continue
        folder = Path(found["REPOSITORY_PATH"])
        at = _git("-C", folder, "rev-parse", "--short=8", "HEAD").stdout.strip()
        file = Path(found["URDF_PATH"] or found["XACRO_PATH"])
        if not file.is_file():
            yield replace(bare, why=f"{NOT_FETCHED}: the repository has no such file at {at}")
            continue
        yield replace(
            bare,
            source=f"{name} at {at}",
            file=file,
            folder=folder,
            arguments=tuple((found["XACRO_ARGS"] or {}).items()),
        )


def _imported(name: str, more: dict[str, str]) -> tuple[dict[str, Any] | None, str]:
    """Return what a module of robot_descriptions says, or why it cannot be imported."""
    command = [sys.executable, "-c", _ASKED, name]
    environment = os.environ | {"GIT_TERMINAL_PROMPT": "0"} | more
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        return None, _last_line(done.stderr)
    found: dict[str, Any] = json.loads(done.stdout)
    return found, ""


def _git(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"GIT_TERMINAL_PROMPT": "0"}
    return subprocess.run(
        ["git", *map(str, arguments)], env=environment, capture_output=True, text=True, check=False
    )


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    said = [line for line in lines if line.startswith(("fatal:", "stderr: 'fatal:"))]
    return (said or lines or ["no word of why"])[-1].removeprefix("stderr: ").strip("'")


# Which links are tools.


def tips(text: str) -> dict[str, int]:
    """Return the ends of a URDF's chains of two joints or more, one for each set of joints.

    Of each, how many joints move it. Where chains share more than half of their joints, as fingers
    do, they end where they part: at the hand.
    """
    chains = _chains(text)
    ends: dict[tuple[str, ...], str] = {}
    for names, links in chains:
        # What ends on the way, like a sensor on a thigh, does not shorten a chain.
        parting = [other for other, _ in chains if _shared(names, other) < len(other)]
        shared = max((_shared(names, other) for other in parting), default=0)
        if 2 * shared > len(names):
            names, links = names[:shared], links[: shared + 1]
        if len(names) > 1:
            # An end of its own, like a tool's frame, or the last link.
            own = next((at[-1][-1] for other, at in chains if other == names), links[-1][0])
            ends.setdefault(names, own)
    contained = {names for names in ends for other in ends if other[: len(names)] == names != other}
    return {end: len(names) for names, end in ends.items() if names not in contained}


def _chains(text: str) -> list[tuple[tuple[str, ...], list[list[str]]]]:
    """Return for each end its movable joints, and the links between them, root first."""
    joints = [x for x in ElementTree.fromstring(text).findall("joint") if x.get("type")]
    above = {x.find("child").get("link"): x for x in joints}  # type: ignore[union-attr]
    followed = {x.find("mimic").get("joint") for x in joints if x.find("mimic") is not None}
    parents = {x.find("parent").get("link") for x in joints}  # type: ignore[union-attr]
    found = []
    for link in [x for x in above if x not in parents]:
        names, links = list[str](), [[str(link)]]
        while link in above:
            joint = above[link]
            link = joint.find("parent").get("link")  # type: ignore[union-attr]
            is_finger = joint.get("name") in followed and not names
            if joint.find("mimic") is not None or is_finger:
                names, links = [], [[str(link)]]  # of a gripper: the chain ends before it
            elif joint.get("type") == "fixed":
                links[0].insert(0, str(link))
            else:
                names.insert(0, str(joint.get("name")))
                links.insert(0, [str(link)])
        found.append((tuple(names), links))
    return found


def _shared(one: tuple[str, ...], other: tuple[str, ...]) -> int:
    same = (a == b for a, b in zip(one, other, strict=False))
    return next((k for k, is_same in enumerate(same) if not is_same), min(len(one), len(other)))


# How far each comes.


def rows_of(description: Description) -> list[Row]:
    """Plan with a description: with each of its chains, or of the other lists with the longest."""
    bare = Row(description.of, description.arm, description.source, why=description.why)
    if description.file is None:
        return [bare]
    try:
        text = text_of(description)
        ends = tips(text)
    except sm.SelfmotionError as error:
        return [replace(bare, why=_shortened(f"{type(error).__name__}: {error}", description))]
    except ElementTree.ParseError as error:
        return [replace(bare, why=f"RobotError: {error}")]
    if not ends:
        return [replace(bare, why="no chain of two joints")]
    if description.of != CHAINS:
        ends = dict([max(ends.items(), key=lambda end: end[1])])
    return [_row(replace(bare, tool=tool), description, text) for tool in ends]


def text_of(description: Description) -> str:
    """Return the URDF of a description, expanded where it is xacro."""
    file, folder = description.file, description.folder
    assert file is not None
    assert folder is not None
    if file.suffix != ".xacro" and not is_xacro(file):
        return file.read_text("utf-8", errors="replace").removeprefix("\ufeff").lstrip()
    folders = tuple(map(str, (folder, *description.more)))
    return expand(file, dict(description.arguments), Packages(file, folders))


def _row(bare: Row, description: Description, text: str) -> Row:
    """Return what became of one tool: loaded, and planned by two commands."""
    assert description.file is not None
    assert description.folder is not None
    folders = [description.folder, *description.more]
    arguments = dict(description.arguments)
    try:
        robot = sm.load_robot(description.file, bare.tool, arguments=arguments, packages=folders)
    except sm.SelfmotionError as error:
        return replace(bare, why=_shortened(f"{type(error).__name__}: {error}", description))
    except Exception as error:
        return replace(bare, why=f"UNTYPED {error!r}")
    apart = disagreement(robot, text)
    row = replace(bare, joints=robot.dof, loaded=apart <= _AGREE, apart=apart)
    if not row.loaded:
        return replace(row, why=f"the tool is {apart:.2g} from where yourdfpy has it")
    if row.of == CHAINS:
        return _along_a_line(row, robot, description)
    with tempfile.TemporaryDirectory() as name:
        problem = Path(name) / "arm.toml"
        words: list[str | Path] = [description.file, "--tool", bare.tool]
        for folder in folders:
            words += ["--set", f"robot.packages={folder}"]
        for key, value in description.arguments:
            words += ["--set", f"robot.arguments.{key}={value}"]
        code, _, said = _selfmotion("init", *words, "--out", problem)
        if code:
            return replace(row, why=_shortened(said, description))
        code, printed, said = _selfmotion("plan", problem, "--json")
    if code not in (0, 1):
        return replace(row, why=_shortened(said, description))
    outcome = json.loads(printed)
    row = replace(row, planned=True, task=outcome["task"], verified=code == 0)
    verdict = outcome["certificate"]["verdict"]
    return row if row.verified else replace(row, why=_shortened(verdict, description))


def _along_a_line(row: Row, robot: sm.RobotModel, description: Description) -> Row:
    """Return what became of a chain whose tool goes along a line from where it moves it well."""
    task = ""
    try:
        for choice in _TASKS:
            task = choice.value
            if robot.dof > choice.dimension and robot.can_follow(choice):
                break
        apart = sm.constraints.Clearance(distance=0.0, disabled=_disabled(robot))
        start = _start(robot, task, apart)
        begin = robot.pose(start)
        end = begin.copy()
        end.translation = begin.translation + _LENGTH * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
        line = sm.paths.Line(begin, end, _DURATION)
        kept = apart if robot.urdf.has_collisions else None
        plan = sm.plan(sm.Problem(robot, line, task, start, clearance=kept))
    except sm.SelfmotionError as error:
        said = _shortened(f"{type(error).__name__}: {error}", description)
        return replace(row, task=task, why=said)
    except Exception as error:
        return replace(row, task=task, why=f"UNTYPED {error!r}")
    row = replace(row, task=task, planned=True, verified=plan.certificate.verified)
    return row if row.verified else replace(row, why="; ".join(plan.certificate.failures))


def _disabled(robot: sm.RobotModel) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that the SRDF nearest in name leaves out; it may be of a family."""
    urdf = Path(robot.urdf.source)
    found = [x for x in urdf.parents[1].glob("srdf/*.srdf") if "<disable_coll" in x.read_text()]
    named = [x for x in found if urdf.stem.startswith(x.stem) or x.stem.startswith(urdf.stem)]
    if not named:
        return ()
    srdf = min(named, key=lambda x: abs(len(x.stem) - len(urdf.stem)))
    pairs = ElementTree.parse(srdf).getroot().iter("disable_collisions")
    listed = [(str(x.get("link1")), str(x.get("link2"))) for x in pairs]
    return tuple(pair for pair in listed if set(pair) <= set(robot.urdf.links))


def _start(robot: sm.RobotModel, task: str, apart: sm.constraints.Clearance) -> Array:
    """Return the configuration that moves the tool best, or one at random without overlaps."""
    best = robot.dexterous_configuration(task)
    if not robot.urdf.has_collisions:
        return best
    lower, upper = robot.finite_limits()
    shares = np.random.default_rng(0).uniform(0.25, 0.75, (_TRIED, robot.dof))
    tries = [best, *(lower + (upper - lower) * shares)]
    model = apart.model(robot)
    return next((q for q in tries if model.distance(q).value >= 0.0), best)


def disagreement(robot: sm.RobotModel, text: str) -> float:
    """Return how far the tool is from where yourdfpy has it, at most, in random configurations."""
    read = yourdfpy.URDF.load(
        io.BytesIO(text.encode()), load_meshes=False, load_collision_meshes=False
    )
    lower, upper = robot.finite_limits()
    drawn = np.random.default_rng(0).uniform(lower, upper, (_CONFIGURATIONS, robot.dof))
    held = {name: 0.0 for name in read.actuated_joint_names}
    for joint in read.actuated_joints:
        limit = joint.limit
        ends = (None, None) if limit is None else (limit.lower, limit.upper)
        if None not in ends and joint.type != "continuous":
            held[joint.name] = float(np.clip(0.0, *ends))
    worst = 0.0
    for q in drawn:
        at = held | {name: value for name, value in zip(robot.joint_names, q.tolist(), strict=True)}
        read.update_cfg({name: at[name] for name in held})
        theirs = read.get_transform(robot.tool, read.base_link)
        ours = robot.pose(q)
        worst = max(
            worst,
            float(np.abs(theirs[:3, 3] - ours.translation).max()),
            float(np.abs(theirs[:3, :3] - ours.rotation).max()),
        )
    return worst


def _selfmotion(*words: str | Path) -> tuple[int, str, str]:
    """Run a command; return its exit code, what it printed, and what it said was wrong."""
    command = [str(Path(sys.executable).parent / "selfmotion"), *map(str, words)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=_PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return 2, "", f"ended after {_PATIENCE:.0f} s ({words[0]})"
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    if done.returncode not in (0, 1) and not errors:
        return 2, "", f"UNTYPED {words[0]}: {_last_line(done.stderr)}"
    said = errors[-1].removeprefix("error: ") if errors else ""
    return done.returncode, done.stdout, f"{words[0]}: {said}"


def _shortened(words: str, description: Description) -> str:
    """Return words without where the file is on this machine."""
    words = re.sub(rf"{re.escape(tempfile.gettempdir())}/tmp\w+/arm\.toml: ", "", words)
    for path in (description.file, description.folder, *description.more):
        if path is not None:
            for spelled in {str(path), str(path.resolve())}:
                words = words.replace(f"{spelled}: ", "").replace(f"{spelled}/", "")
                words = words.replace(spelled, path.name)
    return words


# The page.

_HEAD = """# Arms that people have

Written by `make bench NAME=arms`, which fetches the repositories of `benchmarks/makers.csv` and of
the package robot_descriptions ({list_version}) when it first needs them: that takes a network, and
rows without a file say *not fetched*. Of example-robot-data ({chains_version}) it is each chain
of two joints or more, arms, legs and fingers; of other files the longest one.

Each file of the first two goes through two commands as they stand: `selfmotion init FILE --tool
TOOL --packages FOLDER` writes a problem, a circle in the task with the most rows that leaves
self-motion, and `selfmotion plan` plans and judges it. Chains follow a line of {length:.0f} cm in
{duration:.0f} s, from a configuration that moves them well. *Loaded* says besides that the tool
stands where yourdfpy has it, within 1e-7 at {configurations} random configurations; the largest
difference of all was {apart:.1g}.

| descriptions | tried | not fetched | loaded | planned | verified |
| --- | --- | --- | --- | --- | --- |
"""
_COLUMNS = """
| arm | source | tool | joints | task | loaded | planned | verified | why not |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


def counts(rows: Sequence[Row]) -> tuple[int, int, int, int, int]:
    """Return how many were tried, not fetched, loaded, planned and verified."""
    return (
        len(rows),
        sum(not row.is_fetched for row in rows),
        sum(row.loaded for row in rows),
        sum(row.planned for row in rows),
        sum(row.verified for row in rows),
    )


def page(rows: Sequence[Row]) -> str:
    """Return the page."""
    text = _HEAD.format(
        list_version=_version("robot_descriptions"),
        chains_version=_version("example-robot-data"),
        configurations=_CONFIGURATIONS,
        length=100.0 * _LENGTH,
        duration=_DURATION,
        apart=max((row.apart for row in rows if row.loaded), default=0.0),
    )
    for of in (MAKERS, LIST, CHAINS):
        told = " | ".join(map(str, counts([row for row in rows if row.of == of])))
        text += f"| {of} | {told} |\n"
    text += f"| all | {' | '.join(map(str, counts(rows)))} |\n" + _COLUMNS
    for row in rows:
        why = row.why.replace("|", "\\|").replace("<", "&lt;")
        cells = [row.arm, row.source, row.tool, str(row.joints or ""), row.task]
        cells += ["yes" if is_so else "no" for is_so in (row.loaded, row.planned, row.verified)]
        text += f"| {' | '.join([*cells, why])} |\n"
    return text


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError

    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def main(
    only: Annotated[str, typer.Option(help="Part of the names of arms or sources.")] = "",
    lists: Annotated[list[str] | None, typer.Option("--list", help="Which lists.")] = None,
    out: Annotated[Path, typer.Option(help="The page.")] = PAGE,
    cache: Annotated[Path, typer.Option(help="Folder of clones.")] = CACHE,
    kept: Annotated[
        Path | None, typer.Option(help="Rows of earlier runs (.jsonl), which are not run again.")
    ] = None,
    workers: Annotated[int, typer.Option(help="Commands at once.")] = 2,
) -> None:
    """Plan with all descriptions, and write the page."""
    known = _read(kept)
    found: list[Description] = []
    for of, wanted in ((MAKERS, of_makers(cache)), (LIST, of_list()), (CHAINS, of_chains())):
        if lists is None or of in lists:
            found += [x for x in wanted if only.lower() in f"{x.arm} {x.source}".lower()]
    rows: list[Row] = []
    with ThreadPoolExecutor(workers) as pool:
        todo = (
            known.get((x.of, x.arm, x.source)) or pool.submit(rows_of, x)  # as they come
            for x in found
        )
        for description, task in zip(found, list(todo), strict=True):
            news = task if isinstance(task, list) else task.result()
            rows += news
            if kept is not None and not isinstance(task, list):
                with kept.open("a") as file:
                    file.writelines(json.dumps(asdict(row)) + "\n" for row in news)
            print(description.arm, *news, sep="\n  ", flush=True)
    out.write_text(page(rows), "utf-8")
    sys.exit(1 if any(row.is_wrong for row in rows) else 0)


def _read(kept: Path | None) -> dict[tuple[str, str, str], list[Row]]:
    known: dict[tuple[str, str, str], list[Row]] = {}
    with contextlib.suppress(FileNotFoundError):
        for line in kept.read_text().splitlines() if kept is not None else ():
            row = Row(**json.loads(line))
            known.setdefault((row.of, row.arm, row.source), []).append(row)
    return known


if __name__ == "__main__":
    typer.run(main)
