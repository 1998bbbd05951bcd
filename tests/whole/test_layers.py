"""No circles of imports in a package, none past another's door; layers of packages are lint's."""

import ast
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import selfmotion as sm

SOURCE = Path(sm.__file__).parent


def imported(tree: ast.AST) -> Iterator[tuple[str, list[str]]]:
    """Yield modules that a file imports with the names of them, those for type checkers left out.

    Imports inside functions count.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module, [name.name for name in node.names]
        elif isinstance(node, ast.Import):
            yield from ((name.name, []) for name in node.names)
        else:
            yield from imported(node)


def arrows(sources: Mapping[str, str], package: str) -> dict[str, set[str]]:
    """Return file → files of the same package that it imports, of a package's files."""
    found: dict[str, set[str]] = {name: set() for name in sources}
    for name, text in sources.items():
        for module, names in imported(ast.parse(text)):
            if module == package:
                # A name that is no file comes from the package's door, which imports all files.
                of_door = [each for each in names if each not in sources]
                found[name] |= set(sources) if of_door else set(names)
            elif module.rpartition(".")[0] == package:
                found[name].add(module.rpartition(".")[2])
    return {name: others & set(sources) for name, others in found.items()}


def circle(sources: Mapping[str, str], package: str) -> list[str]:
    """Return the files of a circle of imports, the first one also last; empty for none."""
    try:
        TopologicalSorter(arrows(sources, package)).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


PACKAGES = sorted(file.parent for file in SOURCE.rglob("__init__.py"))


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda folder: folder.name)
def test_no_files_of_a_package_import_each_other(folder: Path) -> None:
    package = ".".join(folder.relative_to(SOURCE.parent).parts)
    files = {file.stem: file.read_text("utf-8") for file in folder.glob("*.py")}
    files.pop("__init__")
    assert circle(files, package) == []


def test_circles_are_seen() -> None:
    sources = {
        "a": "from package.b import x",
        "b": "def y():\n    from package.c import z",
        "c": "import package.a",
    }
    assert len(circle(sources, "package")) == 4
    assert circle({**sources, "c": ""}, "package") == []
    typed = "if TYPE_CHECKING:\n    from package.a import x"
    assert circle({**sources, "c": typed}, "package") == []
    assert circle({"a": "from package import b", "b": ""}, "package") == []
    assert circle({"a": "from package import x", "b": ""}, "package") == ["a", "a"]


# What compiles ahead names kernels of all packages.
COMPILES_AHEAD = "realtime/warm.py"
# Folders of a package in its wing: `selfmotion.model.robot`.
DEPTH = 3


def past_doors(text: str, package: str) -> list[str]:
    """Return the files of other packages that a file of a package imports from, without a door."""
    modules = [module for module, _ in imported(ast.parse(text))]
    parts = [module.split(".") for module in modules]
    return [
        ".".join(each)
        for each in parts
        if each[0] == "selfmotion" and len(each) > DEPTH and each[:DEPTH] != package.split(".")
    ]


def test_nothing_is_imported_past_the_door_of_another_package() -> None:
    found = {}
    for file in SOURCE.rglob("*.py"):
        place = file.relative_to(SOURCE.parent)
        package = ".".join(place.parent.parts[:DEPTH])
        past = past_doors(file.read_text("utf-8"), package)
        if past and not place.as_posix().endswith(COMPILES_AHEAD):
            found[place.as_posix()] = past
    assert found == {}


def test_an_import_past_a_door_is_seen() -> None:
    text = "from selfmotion.model.path.feed import Feed\nfrom selfmotion.model.robot import Chain"
    assert past_doors(text, "selfmotion.model.robot") == ["selfmotion.model.path.feed"]
    assert past_doors(text, "selfmotion.model.path") == []
