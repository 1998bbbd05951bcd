"""A job killed at 20 random times, and begun again each time: `make bench NAME=fuzz-job`.

The program in the end is that of a run that nothing stopped, and no run does again what an earlier
one had finished. With `--workers 2` other processes plan; the run that nothing stopped is of one.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import selfmotion as sm

EXAMPLE = Path(__file__).parent.parent / "examples" / "frame.toml"


def command(folder: Path, out: Path, workers: int) -> list[str]:
    """Return the command that plans the job."""
    code = "import selfmotion_main; selfmotion_main.main()"
    return [
        *(sys.executable, "-c", code, "job", str(EXAMPLE)),
        *("--folder", str(folder), "--out", str(out), "--workers", str(workers)),
    ]


def main() -> None:
    """Kill runs, and compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--workers", type=int, default=1, help="processes that plan")
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        began = time.perf_counter()
        subprocess.run(command(folder / "whole", folder / "whole.program", 1), check=True)
        seconds = time.perf_counter() - began
        whole = sm.load_program(folder / "whole.program").require()
        killed, lost = 0, 0
        kept: dict[str, int] = {}
        while killed < options.times:
            run = subprocess.Popen(
                command(folder / "kept", folder / "killed.program", options.workers),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            # So short that several runs are needed.
            time.sleep(rng.uniform(0.2, 0.7) * seconds)
            run.kill()
            run.wait()
            killed += 1
            now = {file.name: file.stat().st_mtime_ns for file in (folder / "kept").glob("*.json")}
            lost += sum(now.get(name) != time_ for name, time_ in kept.items())
            kept = now
        last = command(folder / "kept", folder / "killed.program", options.workers)
        subprocess.run(last, check=True)
        again = sm.load_program(folder / "killed.program").require()
        same = again.order == whole.order and np.array_equal(again.trajectory.q, whole.trajectory.q)
        print(f"killed {killed} times: {lost} finished pieces lost, same program: {same}")


if __name__ == "__main__":
    main()
