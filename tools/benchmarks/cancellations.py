"""Cancel programs that drive the emulated base, one to three times at random, and count what still moves then.

    tools/bench cancellations [--runs N] [--seed N]

Each program runs on a base that stays open, or is opened and left by what is cancelled; the judge is the emulator's
true speed at the moment in which the cancelled program returns, and for a second after it.
"""

import argparse
import logging
import random

from labmate.simulation import SimulatedBase, run_virtual, simulated_base
from labmate.testing.cancellation import PROGRAMS, Outcome, cancel_at_random

SPAN_S = 4.5
"""Longer than the longest program takes with its ramp down."""
RUNS_PER_BASE = 50


def main(argv: list[str]) -> int:
    """Run and print; 1 when anything was left moving."""
    parser = argparse.ArgumentParser(
        prog="tools/bench cancellations", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args(argv)
    logging.disable(logging.ERROR)
    rng = random.Random(arguments.seed)
    outcomes: list[Outcome] = []
    while len(outcomes) < arguments.runs:
        count = min(RUNS_PER_BASE, arguments.runs - len(outcomes))
        outcomes += run_virtual(on_one_base(rng, count))
    print(f"{'program':<24}{'cancelled':>10}{'runs':>7}{'ended by it':>13}{'moving':>8}{'moved later':>13}")
    kinds = sorted({(outcome.program, outcome.cancels) for outcome in outcomes})
    for program, cancels in kinds:
        group = [o for o in outcomes if (o.program, o.cancels) == (program, cancels)]
        ended = sum(o.ended == "cancelled" for o in group)
        print(
            f"{program:<24}{cancels:>8} ×{len(group):>7}{ended:>13}"
            f"{sum(o.moving for o in group):>8}{sum(o.moved_later for o in group):>13}"
        )
    moving = sum(o.moving or o.moved_later for o in outcomes)
    print(f"{moving} of {len(outcomes)} left moving")
    return 1 if moving else 0


async def on_one_base(rng: random.Random, count: int) -> list[Outcome]:
    """Cancel some programs on one emulated base, one after the other."""
    programs = [name + context for name in PROGRAMS for context in ("", " in its context")]
    async with simulated_base(seed=rng.getrandbits(16)) as sim:
        return [
            await cancel_at_random(
                rng, sim.open, lambda: moves(sim), rng.choice(programs), rng.randint(1, 3), SPAN_S
            )
            for _ in range(count)
        ]


def moves(sim: SimulatedBase) -> bool:
    """Whether the emulated base really moves, or is told to."""
    true = sim.bench.state()["base"]
    return bool(true["speed"] != 0.0 or true["turn_rate"] != 0.0 or true["mode"] != "idle")
