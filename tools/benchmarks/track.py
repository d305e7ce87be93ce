"""medusa-ctl track in virtual time: two 64² cameras at 6 Hz, a textured target and two walls, everything included.

Issue: at least 5 times faster than real time without extras; goal 20.
"""

import argparse
import json
import sys
import time

from medusa.gaze.retina import Retina
from medusa.gaze.run.assembly import GazeChoice, patch_detectors
from medusa.gaze.run.loop import GazeLoop
from medusa.simulation import run_virtual, simulated_head, simulated_surroundings

NEEDED, GOAL = 5.0, 20.0


async def track(seconds: float) -> dict[str, float]:
    """Wall seconds for homing and for tracking, and how well it went."""
    choice = GazeChoice(frame_rate=6.0)
    world = simulated_surroundings(target="texture", screen="", pixels=64, rate=6.0, latency_ms=60.0)
    begin = time.perf_counter()
    async with simulated_head(0, world=world) as simulation, simulation.open() as head:
        await head.home()
        homed = time.perf_counter()
        lens, geometry = simulation.intrinsics(), simulation.geometry()
        detectors = patch_detectors(simulation.target_patch())
        async with simulation.cameras() as cameras:
            gaze_loop = GazeLoop(
                head, cameras, Retina(lens, lens, *detectors), choice.make_gaze(head.traits, geometry),
                choice.loop_settings(head.traits, geometry),
            )  # fmt: skip
            log = await gaze_loop.run(seconds)
        tracked = time.perf_counter()
    return {
        "homing_wall_s": homed - begin,
        "tracking_wall_s": tracked - homed,
        "times_real_time": seconds / (tracked - homed),
        "rms_error_deg": log.summary()["rms_error_deg"],
    }


def main(argv: list[str]) -> int:
    """Print the figures; the exit code is 1 below 5 times real time."""
    parser = argparse.ArgumentParser(prog="tools/bench track", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="virtual seconds of tracking")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    if not options.seconds > 0.0:
        parser.error(f"--seconds is {options.seconds}, must be above 0")
    found = run_virtual(track(options.seconds))
    if options.json:
        print(json.dumps(found, indent=2))
    else:
        print(
            f"{options.seconds:g} s of tracking in {found['tracking_wall_s']:.2f} s: "
            f"{found['times_real_time']:.1f} times real time (needed {NEEDED:g}, goal {GOAL:g}); "
            f"RMS error {found['rms_error_deg']:.2f}°"
        )
    return int(found["times_real_time"] < NEEDED)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
