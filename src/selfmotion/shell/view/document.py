"""A document while it is changed: its values, what is undone, and the file when it is saved."""

import tomllib
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any, NoReturn

from typing_extensions import override

from selfmotion.basics import FileFormatError, read_document, text_of, write_document, write_text
from selfmotion.planning.result import Plan
from selfmotion.shell.documents import problem_document

# The way to a value: keys of tables, and places in lists.
Keys = tuple[str | int, ...]


class Edited:
    """A problem file that is changed in memory, and written when that is asked for.

    A drag is many changes and one step of `undo`: changes that are not `final` become one with the
    next that is.

    Parameters
    ----------
    file : Path
        .toml, .json or .yaml.

    Raises
    ------
    FileFormatError
        The file cannot be read.
    """

    def __init__(self, file: Path) -> None:
        self._begin(file, read_document(file))

    def _begin(self, file: Path, document: Mapping[str, Any]) -> None:
        self.file = file
        self.document: dict[str, Any] = dict(document)
        self._content = file.read_bytes()
        self._saved = deepcopy(self.document)
        self._past: list[dict[str, Any]] = []
        self._before: dict[str, Any] | None = None

    @property
    def saves(self) -> str:
        """What is written when it is saved, in words."""
        return self.file.name

    @property
    def is_changed(self) -> bool:
        """Whether the file says something else."""
        return self.document != self._saved

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._past) or self._before is not None

    def change(self, values: Mapping[Keys, Any], *, final: bool) -> None:
        """Set values; those of None are taken away. Tables on the way to them are made.

        Raises
        ------
        FileFormatError
            A way leads through something that is no table and no list.
        """
        changed = deepcopy(self.document)
        for keys, value in values.items():
            _set(changed, keys, deepcopy(value))
        if self._before is None:
            self._before = self.document
        self.document = changed
        if final:
            if self._before != self.document:
                self._past.append(self._before)
            self._before = None

    def undo(self) -> None:
        """Go back one step; nothing happens where there is none."""
        if self._before is not None:
            self.document, self._before = self._before, None
        elif self._past:
            self.document = self._past.pop()

    def save(self) -> None:
        """Write the file, whole or not at all; comments of TOML stay where they are.

        Raises
        ------
        FileFormatError
            The file was changed by others since it was read, or cannot be written.
        """
        if not self.file.is_file() or self.file.read_bytes() != self._content:
            raise FileFormatError(
                f"{self.file}: was changed or moved by others since it was opened, and is left as "
                f"it is; keep a copy of what you want of it, and open it again"
            )
        self._write()
        self._content = self.file.read_bytes()
        self._saved = deepcopy(self.document)

    def _write(self) -> None:
        if self.file.suffix == ".toml":
            write_text(self.file, self._toml())
        else:
            write_document(self.file, self.document)

    def _toml(self) -> str:
        import tomlkit

        written = tomlkit.parse(text_of(self.file, self._content))
        _merge(written, self.document)
        text = tomlkit.dumps(written)
        if tomllib.loads(text) != self.document:
            raise FileFormatError(
                f"{self.file}: its layout cannot carry this change; write the tables that are "
                f"inline or dotted as [tables], or keep it as .json"
            )
        return text


class EditedPlan(Edited):
    """The problem of a plan's file, changed like a problem file; what is saved is a plan again.

    Parameters
    ----------
    file : Path
        .npz.
    plan : Plan
        What it holds; then what is saved.

    Raises
    ------
    ProblemError
        Its problem cannot be written, as it holds functions.
    """

    def __init__(self, file: Path, plan: Plan) -> None:
        self.plan = plan
        self._begin(file, problem_document(plan.problem, file))

    @property
    @override
    def saves(self) -> str:
        return f"{self.file.name}: the plan that is shown, with its problem"

    @override
    def _write(self) -> None:
        self.plan.save(self.file)


def is_job(document: Mapping[str, Any]) -> bool:
    """Whether a document is of many seams."""
    return "seams" in document or "job" in document


def at(document: Any, keys: Keys) -> Any:
    """Return the value at the end of a way; None where there is none."""
    for key in keys:
        if not _leads(document, key) or (isinstance(document, Mapping) and key not in document):
            return None
        document = document[key]
    return document


def _set(document: Any, keys: Keys, value: Any) -> None:
    *way, last = keys
    node = document
    for key in way:
        if not _leads(node, key):
            _refuse(keys, node)
        node = node.setdefault(key, {}) if isinstance(node, dict) else node[key]
    if not _leads(node, last):
        _refuse(keys, node)
    if isinstance(node, dict) and value is None:
        node.pop(last, None)
    else:
        node[last] = value


def _leads(node: Any, key: str | int) -> bool:
    """Whether a key can be one of a table, or is a place in a list."""
    is_place = isinstance(node, list) and isinstance(key, int) and key < len(node)
    return isinstance(node, Mapping) or is_place


def _refuse(keys: Keys, node: Any) -> NoReturn:
    name = ".".join(map(str, keys))
    raise FileFormatError(f"{name}: leads through {node!r}, expected a table or a list")


def _merge(written: Any, values: Mapping[str, Any]) -> None:
    """Make a table of tomlkit say what is wanted, and leave the rest of its text."""
    for key in [key for key in written if key not in values]:
        del written[key]
    for key, value in values.items():
        if key not in written:
            written[key] = _inline(value) if isinstance(value, dict) else value
        else:
            _merge_item(written, key, value)


def _inline(value: dict[str, Any]) -> Any:
    """Return a new table as poses are written: in one line."""
    import tomlkit

    table = tomlkit.inline_table()
    table.update(value)
    return table


def _merge_item(written: Any, key: Any, value: Any) -> None:
    known = written[key]
    if known == value:
        return
    if isinstance(value, dict) and isinstance(known, dict):
        _merge(known, value)
    elif isinstance(value, list) and isinstance(known, list) and len(value) == len(known):
        for place, item in enumerate(value):
            _merge_item(known, place, item)
    else:
        written[key] = value
