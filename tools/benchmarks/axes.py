"""How many times faster than real time the emulated axes run: four in a profile at 2.048 ms, two spare ones idle.

Chip and plant through both boards, woken every 5 ms as their lines wake them, no traffic. Beside it, in the same
run, the bare arithmetic of four such axes in one Python loop: what no emulator in Python can beat.
"""

import argparse
import json
import struct
import sys
import time
from collections.abc import Callable
from math import floor, radians
from statistics import median

from sim_devices.head import JOINTS, HeadConfig, HeadMachine

NEEDED, GOAL = 150.0, 300.0
SECONDS = 4.0
WAKE_S = 0.005
PERIOD_S = 2.048e-3
# Nearest registers of the servo analysis; acceleration 1/256 and maximum so that the profile lasts the whole run.
FILTERS = {
    "pan": (197, 0, 7),
    "tilt": (220, 0, 5),
    "left_vergence": (225, 0, 5),
    "right_vergence": (225, 0, 5),
}
PLACES = {"left_vergence": (1, 0), "right_vergence": (1, 1), "tilt": (1, 2), "pan": (2, 0)}
# By counts: on the right eye they rise as its angle falls.
SWEEP_DEG = {"pan": 160.0, "tilt": 70.0, "left_vergence": 70.0, "right_vergence": 70.0}
START_DEG = {"pan": -80.0, "tilt": -35.0, "left_vergence": -35.0, "right_vergence": 35.0}


def main(argv: list[str]) -> int:
    """Measure and print; 1 when the median is below what is needed."""
    parser = argparse.ArgumentParser(prog="tools/bench axes", description=__doc__)
    parser.add_argument("--repeat", type=int, default=7, help="runs of each (the median counts)")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    arguments = parser.parse_args(argv)
    cases: dict[str, Callable[[], tuple[float, float]]] = {
        "bare arithmetic, four axes": run_bare,
        "emulated axes": lambda: run_emulated(HeadConfig(start_deg=START_DEG), careful=False),
        "the same, sample by sample": lambda: run_emulated(HeadConfig(start_deg=START_DEG), careful=True),
        "with friction and backlash": lambda: run_emulated(
            HeadConfig(start_deg=START_DEG, friction_counts=2.0, backlash_deg=0.02), careful=False
        ),
    }
    wall: dict[str, list[float]] = {name: [] for name in cases}
    processor: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(arguments.repeat):
        for name, run in cases.items():
            elapsed, used = run()
            wall[name].append(SECONDS / elapsed)
            processor[name].append(SECONDS / used)
    medians = {name: median(values) for name, values in wall.items()}
    unloaded = {name: median(values) for name, values in processor.items()}
    if arguments.json:
        figures = {"times_real_time": medians, "by_processor_time": unloaded, "needed": NEEDED, "goal": GOAL}
        json.dump(figures, sys.stdout, indent=2)
        print()
    else:
        bare = unloaded["bare arithmetic, four axes"]
        print(f"{'':<30}{'× real time':>12}{'× processor time':>18}{'of bare':>9}")
        for name, value in medians.items():
            print(f"{name:<30}{value:>12.0f}{unloaded[name]:>18.0f}{unloaded[name] / bare:>9.2f}")
        print(f"needed {NEEDED:.0f}, goal {GOAL:.0f}")
    return 0 if medians["emulated axes"] >= NEEDED else 1


def run_emulated(config: HeadConfig, *, careful: bool) -> tuple[float, float]:
    """Run both boards for SECONDS of their time; return the seconds that it took, on the wall and of processor."""
    machine = HeadMachine(config, seed=0)
    machine.power_up(0.0)
    for amplifier in machine.amplifiers.values():
        amplifier.write(0x07, 0, b"\x0f\0")
        amplifier.write(0x01, 0, b"\0\0")
    for name in JOINTS:
        number, axis = PLACES[name]
        board = machine.boards[number]
        per_radian = getattr(config, name).counts_per_radian
        distance = round(radians(SWEEP_DEG[name]) * per_radian)
        maximum = int(abs(distance) * PERIOD_S / SECONDS)
        machine.channels[name].careful = careful
        for operation, payload in (
            (0x15, bytes((*FILTERS[name], 255))),
            (0x18, struct.pack("<HB", 30, maximum)),
            (0x16, b"\x01"),
            (0x19, struct.pack("<iB", distance, 1)),
        ):
            board.execute(operation, axis, payload)
    boards = list(machine.boards.values())
    begun, begun_cpu = time.perf_counter(), time.process_time()
    for n in range(1, round(SECONDS / WAKE_S) + 1):
        t = n * WAKE_S
        for board in boards:
            board.advance_to(t)
            board.next_due()
    taken = time.perf_counter() - begun, time.process_time() - begun_cpu
    for name in JOINTS:
        if not machine.channels[name].profile_running:
            raise RuntimeError(f"{name} was not in a profile all the time")
    return taken


def run_bare() -> tuple[float, float]:
    """Step filter and zero-order-hold plant of four axes, nothing else, in one loop."""
    decay, reach, gain, rest = 0.88, 1.923e-3, 148.2, 0.154
    m, w, error, output = [0.0] * 4, [0.0] * 4, [0] * 4, [0] * 4
    axes = range(4)
    begun, begun_cpu = time.perf_counter(), time.process_time()
    for n in range(round(SECONDS / PERIOD_S)):
        command = 10 * n
        for i in axes:
            u = output[i]
            m[i] += w[i] * reach + rest * u
            w[i] = w[i] * decay + gain * u
            x = command - floor(m[i])
            u = int(1.25 * x - 1.0986328125 * error[i])
            output[i] = 127 if u > 127 else -128 if u < -128 else u
            error[i] = x
    return time.perf_counter() - begun, time.process_time() - begun_cpu


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
