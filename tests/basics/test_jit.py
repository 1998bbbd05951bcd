"""Machine code on disk that is damaged, or cannot be written, costs time and nothing else."""

import errno
import importlib.util
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import pytest
from numba.core import caching

import selfmotion as sm
from selfmotion.basics import jit
from selfmotion.planning.nodes import local_model
from selfmotion.planning.nodes.kernels import accelerate
from selfmotion.planning.nodes.local_model import differences, neighbours

pytestmark = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT),
    reason="these laws are of machine code: with NUMBA_DISABLE_JIT=1 there is none",
)

SOURCE = """
from selfmotion.basics import kernel

@kernel
def twice(x):
    return 2.0 * x
"""


def loaded(folder: Path) -> Any:
    """Return a module with a kernel of its own, whose cache is beside it."""
    file = folder / "kernels_of_a_test.py"
    if not file.is_file():
        file.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("kernels_of_a_test", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"", b"garbled", b"half"])
def test_a_damaged_cache_heals(suffix: str, content: bytes, tmp_path: Path) -> None:
    assert loaded(tmp_path).twice(1.5) == 3.0
    damaged = [file for file in tmp_path.rglob("*") if file.suffix == suffix]
    assert damaged
    for file in damaged:
        whole = file.read_bytes()
        file.write_bytes(whole[: len(whole) // 2] if content == b"half" else content)
    assert loaded(tmp_path).twice(2.5) == 5.0
    healed = loaded(tmp_path)
    assert healed.twice(3.5) == 7.0
    assert sum(healed.twice.stats.cache_hits.values()) == 1


def test_a_full_disk_ends_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = loaded(tmp_path)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module.twice._cache._cache_file, "save", full)
    assert module.twice(1.5) == 3.0


def test_of_two_processes_one_compiles_and_the_other_waits(tmp_path: Path) -> None:
    (tmp_path / "kernels_of_a_test.py").write_text(SOURCE)
    told = "import kernels_of_a_test as k; k.twice(1.5); print(k.twice.stats.cache_hits.total())"
    both = [
        subprocess.Popen([sys.executable, "-c", told], cwd=tmp_path, stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    hits = sorted(int(one.communicate(timeout=60.0)[0]) for one in both)
    assert hits == [0, 1]


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such locks")
def test_who_waits_compiles_others_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fcntl

    cache = loaded(tmp_path).twice._cache
    cache._impl.locator.ensure_cache_path()
    with open(cache._cache_file._index_path + ".lock", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        done: list[str] = []

        def work() -> None:
            done.append("work")
            fcntl.flock(file, fcntl.LOCK_UN)

        monkeypatch.setattr(jit, "_meanwhile", [work])
        assert loaded(tmp_path).twice(1.5) == 3.0
        assert done == ["work"]
        # Once is enough.
        assert jit._meanwhile == []


def test_what_is_compiled_meanwhile_is_what_a_plan_needs() -> None:
    """Arrays of other kinds would have code of their own."""
    arm = sm.load_robot("panda")
    home = sm.NAMED_ARMS["panda"].home
    sm.plan(sm.Problem(arm, sm.paths.Circle.around(arm.pose(home), 0.05, 2.0), "pose", home))
    kernels = accelerate, neighbours, differences
    before = [kernel.signatures for kernel in kernels]
    local_model._call_what_follows()
    assert [kernel.signatures for kernel in kernels] == before
    assert all(before)


def test_another_process_compiles_where_it_can(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[list[str]] = []
    monkeypatch.setattr(jit.subprocess, "Popen", lambda command, **_: started.append(command))
    for count in (1, 2):
        monkeypatch.setattr(jit.os, "cpu_count", lambda count=count: count)
        jit.compile_in_background(jit.FIRST_WORKS)
    assert [command[-2:] for command in started] == [["selfmotion.realtime.warm", "first"]]
    monkeypatch.setattr(jit, "_IS_ALONE", True)
    assert jit.compile_in_background(jit.ALL_WORKS) is None
    assert len(started) == 1


def test_where_nothing_can_be_written_each_process_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither beside the code nor in the home folder."""

    def read_only(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(caching.tempfile, "TemporaryFile", read_only)
    assert loaded(tmp_path).twice(1.5) == 3.0
    assert [file.name for file in tmp_path.rglob("*") if file.suffix in (".nbi", ".nbc")] == []


def test_kernels_run_as_written_for_a_debugger(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)
    assert isinstance(loaded(tmp_path).twice, FunctionType)
    assert loaded(tmp_path).twice(1.5) == 3.0


@pytest.mark.parametrize(
    ("text", "used"),
    [
        ('{"cpu": "generic", "features": ""}', True),
        ('{"cpu": "x86-64-v3", "features": "+none-has-this"}', False),
        ('{"cpu": "generic"}', False),
        ("[]", False),
        ("{", False),
    ],
)
def test_kernels_of_a_wheel_are_used_where_they_fit(
    text: str, used: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "kernels.json"
    file.write_text(text)
    monkeypatch.setattr(numba.config, "CPU_NAME", None)
    monkeypatch.setattr(numba.config, "CPU_FEATURES", None)
    assert jit.use_built_kernels(file) is used
    assert (numba.config.CPU_NAME is not None) is used
    assert not jit.use_built_kernels(tmp_path / "none.json")


def test_a_processor_that_the_user_chose_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "kernels.json"
    file.write_text('{"cpu": "generic", "features": ""}')
    monkeypatch.setattr(numba.config, "CPU_NAME", "x86-64-v2")
    assert not jit.use_built_kernels(file)
    assert numba.config.CPU_NAME == "x86-64-v2"


RUN = """
import sys
from numba.core import event
class Counted(event.Listener):
    count = 0
    def on_start(self, event): self.count += 1
    def on_end(self, event): pass
counted = Counted()
with event.install_listener("numba:compile", counted):
    from kernels_of_a_test.outer import outer
    print(outer(1.0), counted.count)
"""


@pytest.mark.site
def test_a_change_of_what_a_kernel_calls_in_another_file_compiles_it_anew(tmp_path: Path) -> None:
    """Also of a number that it takes from there, and nothing else does."""
    folder = tmp_path / "kernels_of_a_test"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "other.py").write_text("UNUSED = 1.0\n")
    (folder / "numbers_of_a_test.py").write_text("SHIFT = 10.0\n")
    head = "from selfmotion.basics.jit import inlined, kernel\n"
    inner = folder / "inner.py"
    inner.write_text(f"{head}\n@inlined\ndef inner(x):\n    return 2.0 * x\n")
    (folder / "outer.py").write_text(
        f"{head}from kernels_of_a_test.inner import inner\n"
        "from kernels_of_a_test.numbers_of_a_test import SHIFT\n"
        "from kernels_of_a_test.other import UNUSED\n"
        "\n@kernel\ndef outer(x):\n    return inner(x) + SHIFT\n"
    )

    def value_and_count() -> tuple[float, bool]:
        ended = subprocess.run(
            [sys.executable, "-c", RUN], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        value, count = ended.stdout.split()
        return float(value), int(count) > 0

    assert value_and_count() == (12.0, True)
    assert value_and_count() == (12.0, False)
    inner.write_text(inner.read_text().replace("2.0", "3.0"))
    assert value_and_count() == (13.0, True)
    (folder / "numbers_of_a_test.py").write_text("SHIFT = 20.0\n")
    assert value_and_count() == (23.0, True)
    (folder / "other.py").write_text("UNUSED = 2.0\n")
    assert value_and_count() == (23.0, False)
