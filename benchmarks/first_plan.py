"""What a newcomer waits for: the installation, the first plan, and what is compiled in it.

In an environment of its own: `pip install .`, whose wheel takes compiled kernels along; then the
first plan of the README and every example that needs no other package, each counted by what numba
compiles. Exit code 1 where anything is compiled.
"""

import os
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PLAN = (
    "plan panda --path examples/seam.csv --frame 0.45,-0.1,0.35,0,0,0 --feed 0.05 "
    "--task pointing --set costs.InverseManipulability.mu=0.01 --out seam.npz"
)
COUNTED = """
import runpy, sys
from numba.core import event
class Counted(event.Listener):
    count = 0
    def on_start(self, event): self.count += 1
    def on_end(self, event): pass
counted = Counted()
with event.install_listener("numba:compile", counted):
    try:
        RUN
    except SystemExit:
        pass
print(f"compiled: {counted.count}")
"""
SHELL = "from selfmotion_main import main; main()"
EXAMPLE = 'runpy.run_path(sys.argv[1], run_name="__main__")'
# What needs other packages, or a robot's own software.
LEFT_OUT = {"dask_cluster", "ros2_handover"}


class Spent(NamedTuple):
    """What a process took: by the clock [s], of the processor [s], and what it printed."""

    clock: float
    processor: float
    printed: str


def run(arguments: list[str], folder: Path) -> Spent:
    """Run a process, and return what it took; its children are counted."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    environment = {**os.environ, "PIP_CONSTRAINT": str(ROOT / "constraints.txt")}
    ended = subprocess.run(
        arguments, env=environment, cwd=folder, capture_output=True, text=True, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return Spent(time.monotonic() - start, processor, ended.stdout)


def main() -> int:
    """Print the times and what was compiled after all; return 1 where something was."""
    compiled = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run([sys.executable, "-m", "venv", "env"], folder)
        python = str(folder / "env" / "bin" / "python")
        pip = [python, "-m", "pip", "--quiet", "--disable-pip-version-check"]
        whole = run([*pip, "install", str(ROOT)], folder)
        print(f"pip install .: {whole.clock:.0f} s by the clock, {whole.processor:.0f} s processor")
        built = run([*pip, "wheel", "--no-deps", "--wheel-dir", "wheel", str(ROOT)], folder)
        size = next((folder / "wheel").glob("*.whl")).stat().st_size / 1e6
        print(
            f"  of these the wheel with its kernels: {built.clock:.0f} s by the clock, "
            f"{built.processor:.0f} s processor, {size:.1f} MB"
        )
        # Examples draw and read with packages that a plan does not need.
        run([*pip, "install", "matplotlib", "ezdxf", "mcap-ros2-support"], folder)
        # They write beside themselves.
        for each in ("examples", "robots"):
            shutil.copytree(ROOT / each, folder / each)
        counted = [python, "-c", COUNTED.replace("RUN", SHELL), *shlex.split(PLAN)]
        for which in ("first", "second"):
            plan = run(counted, folder)
            compiled += (count := _count(plan))
            print(f"{which} plan of the README: {plan.clock:.1f} s, {count} kernels compiled")
        for file in sorted((folder / "examples").glob("*.py")):
            if file.stem in LEFT_OUT:
                continue
            example = run([python, "-c", COUNTED.replace("RUN", EXAMPLE), str(file)], file.parent)
            compiled += (count := _count(example))
            if count:
                print(f"  {file.name}: compiles {count}")
    print(f"compiled in all: {compiled}")
    return int(compiled > 0)


def _count(spent: Spent) -> int:
    return int(spent.printed.rsplit(":", 1)[1])


if __name__ == "__main__":
    sys.exit(main())
