"""Runs the benchmarks and prints the table of the page on performance.

`make bench NAME=timings`.
"""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
OUT = HERE.parent / "out"
# Between these the page has the table.
BEGIN, END = "<!-- --8<-- [start:bench] -->", "<!-- --8<-- [end:bench] -->"


def main() -> int:
    """Run pytest-benchmark, write out/bench.json and out/bench.md."""
    OUT.mkdir(exist_ok=True)
    raw = OUT / "bench.json"
    command = [
        sys.executable, "-m", "pytest", "-q", str(HERE), "-p", "no:cacheprovider",
        "--benchmark-json", str(raw), "--benchmark-warmup=on", "--benchmark-quiet",
    ]  # fmt: skip
    code = subprocess.run(command, check=False).returncode
    if code != 0:
        return code
    rows = figures(json.loads(raw.read_text()))
    lines = ["| figure | measured |", "| --- | --- |", *(f"| {a} | {b} |" for a, b in rows)]
    (OUT / "bench.md").write_text("\n".join(lines) + "\n")
    _put_into_page(lines)
    table = Table("figure", "measured", box=box.SIMPLE_HEAD)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    return 0


def _put_into_page(lines: list[str]) -> None:
    page = HERE.parent / "docs" / "pages" / "performance.md"
    before, rest = page.read_text().split(BEGIN)
    after = rest.split(END)[1]
    table = "\n".join(lines)
    page.write_text(f"{before}{BEGIN}\n{table}\n{END}{after}")


def figures(report: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the rows of the table, ratios of medians within this run."""
    entries = {entry["name"]: entry for entry in report["benchmarks"]}

    def seconds(name: str) -> float:
        return float(entries[name]["stats"]["median"])

    loop = seconds("test_pinocchio_loop")
    rows = [
        ("machine", f"{machine()}, Python {platform.python_version()}"),
        (
            "Pinocchio's Jacobians and poses along a rollout (Panda, 50 steps)",
            f"{loop * 1e3:.2f} ms",
        ),
        ("rollout", f"{seconds('test_rollout') / loop:.1f} × that"),
        ("rollout + exact gradient", f"{seconds('test_rollout_and_gradient') / loop:.1f} × that"),
    ]
    for name, entry in entries.items():
        info = entry["extra_info"]
        if name.startswith("test_plan["):
            rows.append(
                (
                    f"plan: {entry['param']}",
                    f"{seconds(name) * 1e3:.0f} ms, cost {info['initial_cost']:.4f} → "
                    f"{info['cost']:.4f}{_broken(info)}, {info['evaluations']} evaluations on all "
                    f"grids",
                )
            )
    for name, entry in entries.items():
        info = entry["extra_info"]
        if name.startswith("test_published_scheme["):
            outcome = "to the same cost" if info["reached"] else "without reaching our cost"
            jacobians = info["jacobian_evaluations"] / info["our_jacobian_evaluations"]
            rows.append(
                (
                    f"the paper's scheme (tolerance {entry['params']['rtol']:g}): "
                    f"{entry['params']['name']}",
                    f"{jacobians:.0f} × our Jacobian evaluations, "
                    f"{seconds(name) / info['our_seconds']:.0f} × our time {outcome} (1e-4); its "
                    f"cost of the minimum-norm motion is off by {info['error_at_0']:.0e}, ours by "
                    f"{info['our_error_at_0']:.0e}",
                )
            )
        if name.startswith("test_scipy_bfgs["):
            ours = entries[f"test_our_optimiser[{entry['param']}]"]
            rows.append(
                (
                    f"SciPy's BFGS, same objective: {entry['param']}",
                    f"{info['evaluations']} evaluations to {info['cost']:.6f}, ours "
                    f"{ours['extra_info']['evaluations']} to {ours['extra_info']['cost']:.6f} "
                    f"(1 % after {ours['extra_info']['evaluations_to_1_percent']}, 1e-6 after "
                    f"{ours['extra_info']['evaluations_to_1e_6']}); "
                    f"{seconds(name) / ours['stats']['median']:.1f} × our time",
                )
            )
    for group, key in (("joints", "joints"), ("steps", "steps"), ("degree", "degree")):
        points = [e for e in entries.values() if e["group"] == f"growth in {group}"]
        x = np.log([e["extra_info"][key] for e in points])
        y = np.log([e["stats"]["median"] for e in points])
        steepest = float(np.max(np.diff(y) / np.diff(x)))
        overall = float(np.polyfit(x, y, 1)[0])
        rows.append(
            (
                f"growth of one evaluation in {group} "
                f"({points[0]['extra_info'][key]}–{points[-1]['extra_info'][key]})",
                f"exponent {overall:.2f}, steepest {steepest:.2f}",
            )
        )
    sizes = [e["extra_info"] for e in entries.values() if e["group"] == "growth in steps"]
    slope = np.polyfit(np.log([s["steps"] for s in sizes]), np.log([s["bytes"] for s in sizes]), 1)
    rows.append(("growth of memory in steps", f"exponent {slope[0]:.2f}"))
    return rows


def _broken(info: dict[str, Any]) -> str:
    """Return why a plan costs more than the minimum-norm motion, if it does."""
    dearer = info["cost"] > info["initial_cost"]
    return " (the minimum-norm motion violates limits)" if dearer else ""


def machine() -> str:
    """Return the processor's name, where the system tells."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())
