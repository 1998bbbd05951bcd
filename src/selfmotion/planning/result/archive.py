"""Files of plans, and keys of finished work."""

import dataclasses
import hashlib
import json
import sys
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from pathlib import Path, Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import (
    Array,
    CollisionError,
    FileFormatError,
    RobotError,
    Saved,
    SelfmotionError,
    digest_of,
    digest_of_file,
    read_archive,
    restore,
    version,
    write_archive,
    write_text,
)
from selfmotion.certificate import Certificate, DampedStretch, Extreme, Finding, Tolerance
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import NullMotion, Trajectory
from selfmotion.model.robot import RobotModel, mesh_digests
from selfmotion.planning.optimise import Iteration, Status
from selfmotion.planning.result.report import FUNCTION, Attempt, Gap, Report
from selfmotion.problem.constraints import (
    ActiveConstraint,
    Clearance,
    Constraint,
    separate_clearances,
)
from selfmotion.problem.problem import (
    Problem,
    conditions_digest,
    problem_from_dict,
    problem_to_dict,
)


def in_order_of(robot: RobotModel, motion: Trajectory) -> Trajectory:
    """Return a motion in the robot's order of joints; one of other joints as it is."""
    names = robot.joint_names
    if motion.joint_names == names or set(motion.joint_names) != set(names):
        return motion
    return motion.of_joints(names)


def key_of(task: Any, files: Any) -> str:
    """Return the digest of a task, as JSON-safe values, and of the files it reads.

    It includes the package's version, and files of classes outside of the package: their changes
    invalidate the work.
    """
    return digest_of(version(), task, files, _code_of(task))


def write_kept(file: Path, values: Mapping[str, Any]) -> None:
    """Write values of finished work, with its own name and a digest of it; atomically."""
    known = {"kept": file.stem, **values}
    write_text(file, json.dumps({**known, "whole": digest_of(known)}) + "\n")


def read_kept(file: Path) -> dict[str, Any] | None:
    """Return the values of `write_kept` to this very file; None for anything else."""
    try:
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        whole = found.pop("whole")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    own = whole == digest_of(found) and found.pop("kept") == file.stem
    return found if own else None


def own_modules(task: Any) -> list[str]:
    """Return the modules, not of this package, of the classes that JSON-safe values name.

    Including those of values inside of others, and of base classes.
    """
    strangers = [(kind, cls) for kind, cls in _classes() if not _is_ours(cls)]
    if not strangers:
        return []
    names = set(_named(task))
    found = {base for kind, cls in strangers if kind in names for base in cls.__mro__}
    return sorted({cls.__module__ for _, cls in strangers if cls in found})


def _classes() -> Iterator[tuple[str, type]]:
    """Yield all classes that files know, with the name by which they do."""
    for cls in _below(Saved):
        yield getattr(cls, "kind", ""), cls
    for cls in _below(Obstacle):
        yield getattr(cls, "shape", ""), cls


def _below(cls: type) -> Iterator[type]:
    several: list[type] = cls.__subclasses__()
    for each in several:
        yield each
        yield from _below(each)


def _is_ours(cls: type) -> bool:
    return cls.__module__.partition(".")[0] == __name__.partition(".")[0]


def _named(value: Any) -> Iterator[str]:
    """Yield the names of classes in a description."""
    if isinstance(value, Mapping):
        yield from (value[key] for key in ("kind", "shape") if isinstance(value.get(key), str))
        for item in value.values():
            yield from _named(item)
    # Long lists are of numbers.
    elif isinstance(value, list | tuple) and not (value and isinstance(value[0], float)):
        for item in value:
            yield from _named(item)


def _code_of(task: Any) -> dict[str, str]:
    """Return the digests of the files in which the user's own classes are that values name."""
    return {name: _code_in(name) for name in own_modules(task)}


def _code_in(module: str) -> str:
    file = getattr(sys.modules.get(module), "__file__", None)
    return digest_of_file(Path(file)) if file else ""


def identity_of(value: Any) -> Any:
    """Return the identity of a setting: its values, and the source of its class."""
    if isinstance(value, Mapping):
        return {name: identity_of(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [identity_of(item) for item in value]
    if isinstance(value, np.random.Generator):
        return identity_of(value.bit_generator.state)
    if value is None or isinstance(value, bool | int | float | str | np.ndarray | np.generic):
        return value
    kind = value if hasattr(value, "__qualname__") else type(value)
    code = "" if _is_ours(kind) else _code_in(kind.__module__)
    held = {} if kind is value else identity_of(getattr(value, "__dict__", repr(value)))
    return [f"{kind.__module__}.{kind.__qualname__}", code, held]


def files_of(
    robot: RobotModel, constraints: Sequence[Constraint], known: MutableMapping[str, Any]
) -> dict[str, str]:
    """Return the SHA-256 of each mesh file of bodies; "" for one that is missing.

    Those of an arm are read once, and stored in `known`.
    """
    # The same text names other files where its packages are elsewhere.
    own = f"meshes of {robot.urdf.sha256} in {robot.urdf.package_dirs}"
    if own not in known:
        known[own] = mesh_digests(robot.urdf, "collision")
    apart, others = separate_clearances(constraints, None)[::-1]
    # Not by the requirement of a clearance, which makes bodies: a good part of a second.
    bodies = [body for item in apart for body in item.obstacles]
    bodies += [body for item in others for body in item.requirement(robot).obstacles]
    given = {str(file): digest_of_file(file) for body in bodies for file in body.files}
    return {**known[own], **given}


class ArmCache(dict[str, Any]):
    """Cache of arms and bodies of this process, by their description; see `load_plan`.

    Cleared when it is large, or when a file of its arms has changed.
    """

    _MANY = 64

    def __init__(self) -> None:
        super().__init__()
        self._files: dict[str, str] = {}

    def of(self, files: Mapping[str, str]) -> "ArmCache":
        """Return itself, for work with bodies of files with these digests."""
        changed = any(self._files.get(name, digest) != digest for name, digest in files.items())
        if changed or len(self) > self._MANY:
            self.clear()
        self._files.update(files)
        return self


# Version of the format: raised with every change that older versions cannot read.
FORMAT = 3
# Key of `Finding.satisfied` in files.
_SATISFIED = "kept"


class Archive(NamedTuple):
    """Content of a plan's file, in the order of `Plan`."""

    problem: Problem
    trajectory: Trajectory
    initial_trajectory: Trajectory
    coefficients: Array
    report: Report
    certificate: Certificate
    altered: str = ""
    changed: tuple[str, ...] = ()

    def write(self, file: FilePath) -> None:
        """Write the file, atomically."""
        history = self.report.history
        description = {
            "format": FORMAT,
            "problem": problem_to_dict(self.problem),
            "meshes": _meshes(self.problem, {}),
            "joint_names": list(self.trajectory.joint_names),
            "report": _report_to_dict(self.report),
            "history": [_without(iteration, "x") for iteration in history],
            "certificate": _certificate_to_dict(self.certificate),
        }
        if self.altered:
            # Writing an altered plan to a new file does not make it verified.
            description["altered"] = self.altered
        arrays = {
            **arrays_of(self.trajectory),
            **arrays_of(self.initial_trajectory, "initial_"),
            "coefficients": self.coefficients,
            "history_x": np.concatenate([np.zeros(0), *(item.x for item in history)]),
            "history_sizes": np.array([len(item.x) for item in history], dtype=np.float64),
        }
        description["digest"] = file_digest(description, arrays)
        write_archive(file, description, arrays)

    @classmethod
    def read(cls, file: FilePath, known: MutableMapping[str, Any] | None = None) -> "Archive":
        """Read a file; FileFormatError where it is none, or of another version.

        The certificate is the written one. Arms and constraints are taken from the cache `known` by
        their description: building their bodies takes a good part of a second.
        """
        description, arrays = read_archive(file)
        if "move" in description:
            raise FileFormatError(
                f"{file}: is a move, not a plan: load_move reads it, and `selfmotion export`"
            )
        check_version(file, "plan", description.get("format"), FORMAT)
        written = description.pop("digest", None)
        altered = str(description.get("altered", ""))
        if written != file_digest(description, arrays):
            altered = f"{file.name} was changed after the plan was written: its digest differs"
        try:
            found = _restore(description, arrays, known)
            then = description.get("meshes", {})
            now = _meshes(found.problem, {} if known is None else known)
            changed = tuple(name for name in then if now.get(name, "") != then[name])
            return found._replace(altered=altered, changed=changed)
        except (CollisionError, RobotError) as error:
            raise FileFormatError(f"{file}: cannot be checked again: {error}") from error
        except SelfmotionError as error:
            raise FileFormatError(f"{file}: is a damaged plan: {error}") from error
        # Any number or key of a damaged plan may be any other, and fail anywhere.
        except Exception as error:
            raise FileFormatError(f"{file}: is no plan, or a damaged one: {error!r}") from error


def _meshes(problem: Problem, known: MutableMapping[str, Any]) -> dict[str, str]:
    """Return the digests of all mesh files of bodies."""
    return files_of(problem.robot, problem.all_constraints, known)


def file_digest(description: Mapping[str, Any], arrays: Mapping[str, Array]) -> str:
    """Return a digest of robot, path, requirements, motion and all else that a file holds."""
    digest = hashlib.sha256(json.dumps(description, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name], dtype=np.float64)
        digest.update(f"{name} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


class OtherVersionError(FileFormatError):
    """A file is of a format that is not read here."""


def check_version(file: FilePath, kind: str, found: object, wanted: int) -> None:
    """Refuse a format that is not ours, and say which version wrote it, where that is known."""
    if found == wanted:
        return
    if isinstance(found, bool) or not isinstance(found, int):
        raise OtherVersionError(
            f"{file}: is no {kind}, or a damaged one: its format is {found!r}, expected {wanted}"
        )
    age = "an older" if found < wanted else "a newer"
    raise OtherVersionError(
        f"{file}: was written by {age} version of selfmotion (a {kind} of format {found}, expected "
        f"{wanted}): make it again, or read it with that version"
    )


def arrays_of(trajectory: Trajectory, prefix: str = "") -> dict[str, Array]:
    """Return the arrays of a motion by name, each with a prefix."""
    named = {"t": trajectory.t, "q": trajectory.q, "qd": trajectory.qd, "qdd": trajectory.qdd}
    return {prefix + name: array for name, array in named.items() if array is not None}


def trajectory_of(
    arrays: Mapping[str, Array], names: tuple[str, ...], prefix: str = ""
) -> Trajectory:
    """Return the motion of which `arrays_of` returned the arrays."""
    t, q, qd = (arrays[prefix + name] for name in ("t", "q", "qd"))
    return Trajectory(t, q, qd, names, arrays.get(prefix + "qdd"))


def _without(value: Any, *names: str) -> dict[str, Any]:
    """Return a dataclass's fields but some."""
    return {
        field.name: getattr(value, field.name)
        for field in dataclasses.fields(value)
        if field.name not in names
    }


def _report_to_dict(report: Report) -> dict[str, Any]:
    return {
        **_without(report, "history"),
        "terms": dict(report.terms),
        # Names of functions of this process mean nothing in another one.
        "costs": {
            name: "" if known.startswith(FUNCTION) else known
            for name, known in (report.costs or {}).items()
        },
        "initial_terms": dict(report.initial_terms),
        "status": report.status.value,
        "gap": None if report.gap is None else dataclasses.asdict(report.gap),
        "active": [dataclasses.asdict(item) for item in report.active],
        "attempts": [dataclasses.asdict(item) for item in report.attempts],
        "null_motion": None if report.null_motion is None else report.null_motion.to_dict(),
    }


def _certificate_to_dict(certificate: Certificate) -> dict[str, Any]:
    values = dataclasses.asdict(certificate)
    for item in values["findings"]:
        # Key of the first version of plan files.
        item[_SATISFIED] = item.pop("satisfied")
    return values


def _certificate_from_dict(values: Mapping[str, Any]) -> Certificate:
    several = {"findings": Finding, "deviations": Extreme, "damped": DampedStretch}
    restored: dict[str, Any] = {
        key: Extreme(**value) if isinstance(value, dict) else value
        for key, value in values.items()
        if key != "tolerance"
    }
    restored["findings"] = [
        {("satisfied" if key == _SATISFIED else key): value for key, value in item.items()}
        for item in restored["findings"]
    ]
    for key, kind in several.items():
        restored[key] = tuple(kind(**item) for item in restored[key])
    restored["others"] = tuple(
        (Extreme(**position), Extreme(**rotation)) for position, rotation in restored["others"]
    )
    restored["tolerance"] = Tolerance(**values["tolerance"])
    for key in ("failures", "covers", "remarks", "notes"):
        restored[key] = tuple(restored[key])
    return Certificate(**restored)


def _restore(
    description: dict[str, Any],
    arrays: Mapping[str, Array],
    known: MutableMapping[str, Any] | None,
) -> Archive:
    names = tuple(description["joint_names"])
    ends = np.cumsum(arrays["history_sizes"]).astype(int)
    points = np.split(arrays["history_x"], ends[:-1]) if len(ends) else []
    history = tuple(
        Iteration(x=x, **record) for x, record in zip(points, description["history"], strict=True)
    )
    report = dict(description["report"])
    report["status"] = Status(report["status"])
    report["gap"] = None if report["gap"] is None else Gap(**report["gap"])
    # Plans of older versions have none.
    report["attempts"] = tuple(Attempt(**item) for item in report.get("attempts", ()))
    motion = report["null_motion"]
    report["null_motion"] = None if motion is None else restore(NullMotion, motion)
    report["active"] = tuple(
        ActiveConstraint(**{**item, "spans": tuple(tuple(span) for span in item["spans"])})
        for item in report["active"]
    )
    problem = problem_from_dict(description["problem"], known)
    return Archive(
        problem=problem,
        trajectory=trajectory_of(arrays, names),
        initial_trajectory=trajectory_of(arrays, names, "initial_"),
        coefficients=arrays["coefficients"],
        report=Report(history=history, **report),
        certificate=_known_again(
            _certificate_from_dict(description["certificate"]), problem, description["problem"]
        ),
    )


def _known_again(
    certificate: Certificate, problem: Problem, described: Mapping[str, Any]
) -> Certificate:
    """Return a certificate with the digest of its problem as it is by now.

    Former versions had clearances among the constraints, and a digest in the order of these.
    """
    kinds = [item["kind"] for item in described["constraints"]]
    if Clearance.kind not in kinds:
        return certificate
    apart, others = iter(problem.clearances), iter(problem.constraints)
    former = [next(apart if kind == Clearance.kind else others) for kind in kinds]
    applying = [item for item in (*former, *apart) if item.applies(problem.robot)]
    if certificate.problem != conditions_digest(problem, applying):
        return certificate
    return dataclasses.replace(certificate, problem=problem.digest)
