"""The command that compiles all kernels, so that nobody waits for them later."""

import time

from numba.core import event

from selfmotion.basics import ALL_WORKS, companion
from selfmotion.cli.app import BEGIN, app, stages, terminal
from selfmotion.cli.stage_display import StageDisplay
from selfmotion.warm import Compiled, small_works


@app.command("warm-up", epilog="Example: selfmotion warm-up", rich_help_panel=BEGIN)
def warm_up() -> None:
    """Compile all numerical kernels now, once per machine, so that no plan waits for them."""
    began = time.perf_counter()
    counted, other = Compiled(), companion(ALL_WORKS)
    with event.install_listener("numba:compile", counted), StageDisplay(stages) as display:
        works = list(small_works())
        for number, (name, work) in enumerate(works):
            display.stage(f"kernels for {name}", number + 1, len(works))
            work()
    count = counted.count + (0 if other is None else int(other.communicate()[0] or 0))
    seconds = time.perf_counter() - began
    told = "nothing was left to compile" if not count else f"{count} kernels"
    terminal.print(f"{told}, {seconds:.0f} s", markup=False)
