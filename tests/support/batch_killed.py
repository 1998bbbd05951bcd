"""A batch whose process is killed by the test that runs it: see test_batch.py."""

import sys
from pathlib import Path

from selfmotion.shell.documents import grid_items
from selfmotion.work.batch import plan_items

if __name__ == "__main__":
    file, out, workers = sys.argv[1:]
    plan_items(
        grid_items(Path(file)),
        out=out,
        workers=int(workers),
        progress=lambda found: sys.stdout.write(f"{found.done}\n") and sys.stdout.flush(),
    )
