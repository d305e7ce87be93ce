"""What `medusa-ctl design` prints: the equations in words, tables 6.1–6.3, and the bytes that were tried."""

import math
from typing import TYPE_CHECKING, Any

from medusa.console import print_table

if TYPE_CHECKING:
    from medusa.servo.design import ServoDesign
    from medusa.servo.thesis import ThesisJoint


def misprints(joint: "ThesisJoint", made: "ServoDesign") -> list[str]:
    """Where table 6.2 prints another number than its own plant gives; nothing for any other plant."""
    from medusa.servo.thesis import PERIOD

    own = math.isclose(made.discrete.period, PERIOD) and math.isclose(made.discrete.pole, joint.printed_pole)
    if not own or not math.isclose(made.discrete.gain, joint.printed_gain):
        return []
    bounds = made.velocity
    found = zip(
        ("(i)", "(ii)", "(iii)"), (bounds.stability, bounds.accuracy, bounds.no_overshoot), strict=True
    )
    return [
        f"the thesis prints {printed:g} for {criterion}; its own plant gives {value:.2f}"
        for (criterion, value), printed in zip(found, joint.printed_velocity_gains, strict=True)
        if f"{value:.1f}" != f"{printed:.1f}"
    ]


def print_designs(designs: "dict[str, ServoDesign]", document: dict[str, Any]) -> None:
    """Print what was designed: constants, equations, tables 6.1–6.3, bytes, and where the figures are."""
    constants = [{"axis": name, **_rounded(document[name]["constants"])} for name in designs]
    print_table(
        "physical constants, joint-referred: R Ω, J kg m², K_E V s/rad, K_T N m/A, E counts/rad, K_A",
        constants,
    )
    for name, made in designs.items():
        _print_equations(name, made)
    print()
    print_table("table 6.1: resolution and speeds in degrees", [_speeds(n, d) for n, d in designs.items()])
    print_table(
        "table 6.2: gain of the proportional velocity mode", [_gains(n, d) for n, d in designs.items()]
    )
    for name, made in designs.items():
        print(f"{name}: {made.velocity.statement()}")
        for misprint in document[name]["velocity"]["misprints"]:
            print(f"{name}: {misprint}")
    print()
    print_table("table 6.3: what the thesis asks of profiles, and what is in the way", _profiles(designs))
    print_table(
        "bytes: worst 2 % settling in ms by step in counts; dead band; margins",
        [_tried(row) for row in document["bytes"]],
    )
    for path in document.get("figures", []):
        print(path)


def _rounded(constants: dict[str, float]) -> dict[str, str]:
    return {key: f"{value:.6g}" for key, value in constants.items()}


def _print_equations(name: str, made: "ServoDesign") -> None:
    plant, filter_, bytes_ = made.discrete, made.filter, made.registers
    print(
        f"{name}: T_M = {1e3 * made.plant.time_constant:.3f} ms, C = {made.plant.velocity_gain:.2f} counts/s\n"
        f"  P(z) = {plant.gain:.4f} (z + {plant.zero:.4f})/((z − 1)(z − {plant.pole:.4f}))\n"
        f"  D(z) = {filter_.gain:.4f} (z − {filter_.zero:.4f})/z, double pole; stable to K = "
        f"{made.compensated_limit:.2f} ({made.uncompensated_limit:.3f} without the zero)\n"
        f"  bytes A = {bytes_.zero}, B = {bytes_.pole}, K = {bytes_.gain}, T = {bytes_.timer}: poles "
        + ", ".join(_pole(pole) for pole in made.poles if pole.imag >= 0)
        + f"; gain margin {made.margins.gain:.2f}, phase margin {made.margins.phase_deg:.1f}°"
    )


def _pole(pole: complex) -> str:
    return f"{pole.real:.4f}" + (f" ± {pole.imag:.4f}i" if pole.imag > 1e-9 else "")


def _speeds(name: str, made: "ServoDesign") -> dict[str, Any]:
    scale = made.scale
    return {
        "axis": name,
        "resolution": f"{math.degrees(1 / scale.counts_per_radian):.5f}",
        "least /s": f"{math.degrees(scale.least_speed):.4f}",
        "chip's most /s": f"{math.degrees(scale.chip_speed):.1f}",
        "amplifier's most /s": f"{math.degrees(scale.amplifier_speed):.1f}",
    }


def _gains(name: str, made: "ServoDesign") -> dict[str, Any]:
    bounds = made.velocity
    return {
        "axis": name,
        "(i) stable <": f"{bounds.stability:.2f}",
        "(ii) error 10 % >": f"{bounds.accuracy:.2f}",
        "(iii) pole 0": f"{bounds.no_overshoot:.2f}",
        "byte K": made.velocity_register,
    }


def _profiles(designs: "dict[str, ServoDesign]") -> list[dict[str, Any]]:
    from medusa.errors import CommandError
    from medusa.servo.thesis import JOINTS

    rows = []
    for name, made in designs.items():
        joint = JOINTS[name]
        try:
            made.scale.check_speed(joint.profile_speed)
            limit = "–"
        except CommandError as error:
            limit = str(error).partition(": ")[2]
        rows.append(
            {
                "axis": name,
                "speed rad/s": f"{joint.profile_speed / math.pi:g} π",
                "acceleration": f"{joint.profile_acceleration / math.pi:g} π",
                "register": made.scale.acceleration_register(joint.profile_acceleration),
                "in the way": limit,
            }
        )
    return rows


def _tried(row: dict[str, Any]) -> dict[str, Any]:
    settling = {str(step): row[f"settling_{step}_ms"] for step in (100, 1000, 10_000)}
    return {
        "axis": row["axis"],
        "bytes": row["bytes"],
        "A,B,K,T": ",".join(str(row[key]) for key in "ABKT"),
        **{step: None if ms is None else f"{ms:.1f}" for step, ms in settling.items()},
        "dead band": f"{row['dead_band_counts']:.1f}",
        "margins": f"{row['gain_margin']:.1f}, {row['phase_margin_deg']:.0f}°",
    }
