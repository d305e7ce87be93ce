"""The demo against real time: 10 Hz snapshots, drivers, ptys and emulators in one process."""

import argparse
import contextlib
import io
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from medusa.cli.demo import run_demo
from medusa.cli.options import Options

RATE_HZ = 10.0


def main(argv: list[str]) -> int:
    """Print virtual over real seconds of the machine alone, and of the command with start-up and picture."""
    parser = argparse.ArgumentParser(prog="tools/bench demo", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args(argv)
    run = Options(sim=True)
    ratios, command = [], []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(options.rounds):
            start = time.perf_counter()
            with contextlib.redirect_stderr(io.StringIO()):
                document, _ = run_demo(run, RATE_HZ, 0.5)
            ratios.append(document["seconds"] / (time.perf_counter() - start))
            start = time.perf_counter()
            words = ["--sim", "demo", "--rate", str(RATE_HZ), "--out", folder]
            subprocess.run(
                [sys.executable, "-c", "from medusa.cli import main; main()", *words],
                check=True,
                capture_output=True,
            )
            virtual = json.loads((Path(folder) / "demo.json").read_text())["seconds"]
            command.append(virtual / (time.perf_counter() - start))
    print(f"demo, {document['seconds']:.1f} s of the head's time, {RATE_HZ:g} Hz snapshots")
    print(
        f"  drivers, ptys, emulators   {statistics.median(ratios):6.1f} × real time (best {max(ratios):.1f})"
    )
    print(
        f"  the command, with picture  {statistics.median(command):6.1f} × real time (best {max(command):.1f})"
    )
    return 0
