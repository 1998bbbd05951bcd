"""How long the first plan on a machine takes, and whether anything compiles after a warm-up.

In processes of their own with empty caches: a plan from a given start, one with a free start, and
``selfmotion warm-up``; then with that cache every example that needs no other package.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLAN = """
import selfmotion as sm
arm = sm.load_robot("panda")
home = sm.NAMED_ARMS["panda"].home
circle = sm.paths.Circle.around(arm.pose(home), 0.1, 4.0)
sm.plan(sm.Problem(arm, circle, "position", START))
"""
COUNTED = """
import runpy, sys
from numba.core import event
import selfmotion
class Counted(event.Listener):
    count = 0
    def on_start(self, event): self.count += 1
    def on_end(self, event): pass
counted = Counted()
with event.install_listener("numba:compile", counted):
    runpy.run_path(sys.argv[1], run_name="__main__")
print(f"compiled: {counted.count}")
"""
SHELL = "import sys; from selfmotion.shell.cli import main; sys.exit(main())"
# What needs other packages, or a robot's own software.
LEFT_OUT = {"dask_cluster", "ros2_handover"}


def run(arguments: list[str], cache: str, folder: str) -> tuple[float, str]:
    """Return the processor time of a process [s], and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | {"NUMBA_CACHE_DIR": cache, "OMP_NUM_THREADS": "1"},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, done.stdout


def main() -> int:
    """Print the times and what compiles after all; return 1 where something does."""
    for name, start in (("given", "home"), ("free", "None")):
        with tempfile.TemporaryDirectory() as cache:
            code = ["-c", PLAN.replace("START", start)]
            first, later = run(code, cache, cache)[0], run(code, cache, cache)[0]
        print(f"first plan, start {name}: {first:.1f} s of the processor; the next {later:.1f} s")
    late = 0
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as folder:
        seconds, _ = run(["-c", SHELL, "warm-up"], cache, folder)
        print(f"warm-up: {seconds:.1f} s")
        # They write beside themselves.
        for name in ("examples", "robots"):
            shutil.copytree(ROOT / name, Path(folder, name))
        for file in sorted((ROOT / "examples").glob("*.py")):
            if file.stem in LEFT_OUT:
                continue
            _, printed = run(
                ["-c", COUNTED, f"{folder}/examples/{file.name}"], cache, f"{folder}/examples"
            )
            count = int(printed.rsplit(":", 1)[1])
            late += count
            if count:
                print(f"  {file.name}: compiles {count} more")
    print(f"compiled after the warm-up: {late}")
    return int(late > 0)


if __name__ == "__main__":
    sys.exit(main())
