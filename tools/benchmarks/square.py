"""The Labmate's 4 m square both ways (some 170 s of its time): everything included, driver, link, pty, emulator.

Beside it, in the same run, as many bare request/reply pairs over a pty with poll, no frame, no driver, no base:
what no driver on this seam can beat.
"""

import argparse
import gc
import json
import os
import select
import sys
import time
import tty
from collections.abc import Callable
from statistics import median

from labmate.calibration import DIRECTIONS
from labmate.simulation import run_virtual, simulated_base
from labmate.square import drive_square

NEEDED_S = 1.0
SIDE = 4.0
REQUEST, REPLY = b"\1" * 8, b"\2" * 26


def main(argv: list[str]) -> int:
    """Measure and print; 1 when the median of the processor's time is above what is needed."""
    parser = argparse.ArgumentParser(prog="tools/bench square", description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="runs of each (the median counts)")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    arguments = parser.parse_args(argv)
    virtual, requests = run_virtual(both_ways())
    squares, bare = [], []
    for _ in range(arguments.repeat):
        squares.append(timed(lambda: run_virtual(both_ways())))
        bare.append(timed(lambda: pairs(requests)))
    wall, cpu = (median(run[i] for run in squares) for i in (0, 1))
    floor = median(run[1] for run in bare)
    document = {
        "virtual_s": virtual,
        "requests": requests,
        "wall_s": wall,
        "processor_s": cpu,
        "times_real_time": virtual / cpu,
        "bare_pairs_processor_s": floor,
        "of_bare": cpu / floor,
        "needed_s": NEEDED_S,
    }
    if arguments.json:
        json.dump(document, sys.stdout, indent=2)
        print()
    else:
        print(f"both ways: {virtual:.1f} s of the base's time, {requests} requests")
        print(f"{'':<28}{'processor s':>12}{'wall s':>9}{'× real time':>13}")
        print(f"{'square, everything':<28}{cpu:>12.3f}{wall:>9.3f}{virtual / cpu:>13.0f}")
        print(f"{'bare pairs over a pty':<28}{floor:>12.3f}{median(run[0] for run in bare):>9.3f}")
        print(f"{cpu / floor:.1f} times the bare pairs; needed under {NEEDED_S:.0f} s")
    return 0 if cpu < NEEDED_S else 1


async def both_ways() -> tuple[float, int]:
    """Drive; return the virtual seconds and the frames that the base took."""
    async with simulated_base(0) as sim, sim.open() as base:
        for direction in DIRECTIONS:
            await drive_square(base, direction, SIDE, true_pose=sim.true_pose)
        return sim.clock(), int((await base.driver.counters())["frames"])


def pairs(count: int) -> None:
    """Requests and replies of the usual lengths over a pty, answered in the same thread, each found by poll."""
    master, slave = os.openpty()
    tty.setraw(slave)
    tty.setraw(master)
    device, host = select.poll(), select.poll()
    device.register(master, select.POLLIN)
    host.register(slave, select.POLLIN)
    try:
        for _ in range(count):
            os.write(slave, REQUEST)
            device.poll()
            os.read(master, 256)
            os.write(master, REPLY)
            host.poll()
            os.read(slave, 256)
    finally:
        os.close(slave)
        os.close(master)


def timed(run: Callable[[], object]) -> tuple[float, float]:
    """Wall and processor seconds."""
    gc.collect()
    wall, cpu = time.perf_counter(), time.process_time()
    run()
    return time.perf_counter() - wall, time.process_time() - cpu
