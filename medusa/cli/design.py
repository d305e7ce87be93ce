"""medusa-ctl design: tables 6.1–6.3, the controllers and figures 6.5–6.7 from physical constants; no machine."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from medusa.cli.options import Options
from medusa.cli.servo import read_bytes
from medusa.cli.tables import print_table

if TYPE_CHECKING:
    from medusa.servo.design import ServoDesign
    from medusa.servo.thesis import Joint

KINDS = "vergence, tilt, pan"


def register(app: typer.Typer) -> None:
    app.command()(design)


def design(
    context: typer.Context,
    joints: Annotated[
        list[str] | None, typer.Argument(metavar="[JOINT]...", help=f"Default: {KINDS}.")
    ] = None,
    timer: int = typer.Option(255, min=7, max=255, help="Sample timer T: the period is 8 µs (T + 1)."),
    resistance: float = typer.Option(None, help="Of the armature, joint-referred, Ω."),
    inertia: float = typer.Option(None, help="Of joint and load, kg m²."),
    back_emf: float = typer.Option(None, help="K_E, joint-referred, V s/rad."),
    torque: float = typer.Option(None, help="K_T, joint-referred, N m/A."),
    lines: float = typer.Option(None, help="Encoder lines N a motor turn; needs --gear."),
    gear: float = typer.Option(None, help="Gear ratio G; needs --lines."),
    amplifier: float = typer.Option(None, help="Amplifier gain K_A."),
    bytes_: str = typer.Option("", "--bytes", metavar="A,B,K,T", help="Judge these bytes on the plant."),
    speed: float = typer.Option(None, help="A speed in degrees/s to be held at this sample period."),
    acceleration: float = typer.Option(None, help="An acceleration in degrees/s² to be held."),
    search: bool = typer.Option(False, "--search", help="Search the best bytes, too."),
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="Draw figures 6.5–6.7 there.")] = None,
) -> None:
    """Design the servo loops from physical constants: plants, filters, bytes, velocity gains, speeds.

    Without constants those of the thesis's head are taken; constants given replace them in every joint named. What
    chip or amplifier cannot do is refused with the number in the way.
    """
    options: Options = context.obj
    given = {
        "resistance": resistance,
        "inertia": inertia,
        "back_emf": back_emf,
        "torque": torque,
        "amplifier": amplifier,
    }

    async def body() -> None:
        from medusa.servo.design import design_servo
        from medusa.servo.position_filter import check_stable
        from medusa.servo.search import search_filter
        from medusa.servo.thesis import JOINTS
        from medusa.servo.trials import assess

        changes = {key: _positive(key, value) for key, value in given.items() if value is not None}
        changes |= _encoder(lines, gear)
        registers = read_bytes(options, bytes_)
        designs: dict[str, ServoDesign] = {}
        document: dict[str, Any] = {}
        tried: list[dict[str, Any]] = []
        for name in joints or JOINTS:
            joint = _joint(name)
            constants = dataclasses.replace(joint.constants, **changes)
            plant = constants.plant
            made = design_servo(plant, constants.encoder, timer, name)
            if speed is not None:
                made.scale.speed_register(math.radians(speed))
            if acceleration is not None:
                made.scale.acceleration_register(math.radians(acceleration))
                if speed is not None:
                    made.scale.check_drive(math.radians(speed), math.radians(acceleration))
            designs[name] = made
            document[name] = {"constants": dataclasses.asdict(constants), **made.as_dict()}
            candidates = {"thesis": made.registers}
            if registers is not None:
                check_stable(plant.at_timer(registers.timer), registers.filter)
                candidates["given"] = registers
            if search:
                candidates["searched"] = search_filter(plant, timer).registers
            for label, bytes_of in candidates.items():
                tried.append(_judged(name, label, assess(plant, bytes_of)))
        document["bytes"] = tried
        if figures is not None:
            document["figures"] = [str(path) for path in _draw(designs, figures)]
        options.show(document, lambda: _print(designs, document))

    options.run(body)


def _joint(name: str) -> "Joint":
    from medusa.errors import CommandError
    from medusa.servo.thesis import JOINTS

    if name not in JOINTS:
        raise CommandError(f"there is no kind of joint {name!r}; there are {', '.join(JOINTS)}")
    return JOINTS[name]


def _positive(key: str, value: float) -> float:
    from medusa.errors import CommandError

    if not (math.isfinite(value) and value > 0):
        raise CommandError(f"{key.replace('_', '-')} = {value:g} must be above 0")
    return value


def _encoder(lines: float | None, gear: float | None) -> dict[str, float]:
    from medusa.errors import CommandError
    from medusa.servo.plant import encoder_gain

    if lines is None and gear is None:
        return {}
    if lines is None or gear is None:
        raise CommandError("--lines and --gear belong together: E = 4 N G/2π")
    return {"encoder": encoder_gain(_positive("lines", lines), _positive("gear", gear))}


def _judged(name: str, label: str, candidate: Any) -> dict[str, Any]:
    r = candidate.registers
    settling = {f"settling_{step}_ms": candidate.settling[step] for step in (100, 1000, 10_000)}
    return {
        "axis": name,
        "bytes": label,
        "A": r.zero,
        "B": r.pole,
        "K": r.gain,
        "T": r.timer,
        **{key: None if math.isinf(value) else 1e3 * value for key, value in settling.items()},
        "dead_band_counts": candidate.dead_band,
    }


def _short(row: dict[str, Any]) -> dict[str, Any]:
    """A row of bytes as the table shows it."""
    return {
        key.removeprefix("settling_").removesuffix("_ms").removesuffix("_counts"): f"{value:.4g}"
        if isinstance(value, float)
        else value
        for key, value in row.items()
    }


def _draw(designs: "dict[str, ServoDesign]", folder: Path) -> list[Path]:
    from medusa.servo.figures import figure_6_5, figure_6_6, figure_6_7, save_figure

    paths = []
    for name, made in designs.items():
        drawn = {"6_5": figure_6_5(made), "6_6": figure_6_6(made), "6_7": figure_6_7(made, made.filter)}
        for number, figure in drawn.items():
            path = folder / f"figure_{number}_{name}.png"
            save_figure(figure, path)
            paths.append(path)
    return paths


def _print(designs: "dict[str, ServoDesign]", document: dict[str, Any]) -> None:
    constants = [{"axis": name, **_rounded(document[name]["constants"])} for name in designs]
    print_table("physical constants, joint-referred: R, J, K_E, K_T, E, K_A", constants)
    for name, made in designs.items():
        _print_equations(name, made)
    print()
    print_table("table 6.1: resolution and speeds in degrees", [_speeds(n, d) for n, d in designs.items()])
    print_table(
        "table 6.2: gain of the proportional velocity mode", [_gains(n, d) for n, d in designs.items()]
    )
    for name, made in designs.items():
        print(f"{name}: {made.velocity.statement()}")
    print()
    print_table("table 6.3: what the thesis asks of profiles, and what stands in the way", _profiles(designs))
    print_table(
        "bytes: 2 % settling in ms by step in counts; dead band", [_short(r) for r in document["bytes"]]
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

    rows = []
    for name, made in designs.items():
        joint = _joint(name)
        try:
            made.scale.check_speed(joint.profile_speed)
            told = "–"
        except CommandError as error:
            told = str(error).partition(": ")[2]
        rows.append(
            {
                "axis": name,
                "speed rad/s": f"{joint.profile_speed / math.pi:g} π",
                "acceleration": f"{joint.profile_acceleration / math.pi:g} π",
                "register": made.scale.acceleration_register(joint.profile_acceleration),
                "in the way": told,
            }
        )
    return rows
