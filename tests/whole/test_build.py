"""How the package is built: what pip asks first, and what happens where kernels do not compile."""

import importlib.util
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from support.places import ROOT


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.chdir(ROOT)
    spec = importlib.util.spec_from_file_location("build_kernels", ROOT / "build_kernels.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_metadata_come_without_a_wheel(backend: ModuleType, tmp_path: Path) -> None:
    name = backend.prepare_metadata_for_build_wheel(str(tmp_path))
    text = (tmp_path / name / "METADATA").read_text()
    assert "\nName: selfmotion\n" in text
    assert "\nRequires-Dist: numba" in text


def test_only_a_wheel_is_built_with_what_runs_it(backend: ModuleType) -> None:
    assert any(name.startswith("pin>") for name in backend.get_requires_for_build_wheel())
    assert not any(name.startswith("pin>") for name in backend.get_requires_for_build_editable())


def hook(backend: ModuleType, said: list[str]) -> Any:
    made = object.__new__(backend.Kernels)
    made._BuildHookInterface__app = SimpleNamespace(display_warning=said.append)
    made._BuildHookInterface__root = str(ROOT)
    return made


@pytest.mark.parametrize("command", ["raise OSError('no space left')", "import no_such_module"])
def test_a_wheel_without_kernels_is_built_where_they_do_not_compile(
    backend: ModuleType, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backend, "WARM_UP", command)
    said, data = list[str](), {"force_include": {}, "pure_python": True}
    made = hook(backend, said)
    made.initialize("standard", data)
    made.finalize("standard", data, "")
    assert data == {"force_include": {}, "pure_python": True}
    assert "compiled at the first plan" in said[0]
    assert not made._folder.exists()


def test_kernels_that_compile_go_into_the_wheel(
    backend: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = "open('selfmotion/__pycache__/x.nbi', 'w'); open('selfmotion/__pycache__/x.nbc', 'w')"
    command = "import os; os.makedirs('selfmotion/__pycache__', exist_ok=True); " + command
    monkeypatch.setattr(backend, "WARM_UP", command)
    monkeypatch.setenv("NUMBA_CPU_NAME", "x86-64-v3")
    said, data = list[str](), {"force_include": {}, "pure_python": True}
    made = hook(backend, said)
    made.initialize("standard", data)
    names = sorted(Path(name).name for name in data["force_include"].values())
    made.finalize("standard", data, "")
    assert names == ["kernels.json", "x.nbc", "x.nbi"]
    assert data["infer_tag"]
    assert not said


def test_an_editable_install_compiles_nothing(backend: ModuleType) -> None:
    data: dict[str, Any] = {}
    made = hook(backend, [])
    made.initialize("editable", data)
    made.finalize("editable", data, "")
    assert data == {}
