"""The command begins with what imports nothing else."""

import subprocess
import sys
import tomllib

import pytest

from support.places import ROOT


@pytest.mark.parametrize("module", ["selfmotion", "numpy", "pinocchio", "selfmotion.shell.cli.app"])
def test_ctrl_c_while_it_imports_ends_in_one_line(module: str) -> None:
    """At the moment in which a module is looked for, whatever the machine's speed."""
    code = (
        "import os, signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "import selfmotion_main\n"
        "selfmotion_main.main()\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "interrupted\n")


def test_the_command_begins_with_what_imports_nothing_else() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"selfmotion": "selfmotion_main:main"}
    code = "import sys, selfmotion_main; print('selfmotion' in sys.modules, 'numpy' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.split() == ["False", "False"]
