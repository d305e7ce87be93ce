"""medusa-ctl design: tables 6.1–6.3, the controllers and figures 6.5–6.7 from physical constants; no machine."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from medusa.cli.design_tables import misprints, print_designs
from medusa.cli.options import Options
from medusa.cli.servo import read_bytes

if TYPE_CHECKING:
    from medusa.servo.design import ServoDesign
    from medusa.servo.margins import ServoMargins
    from medusa.servo.thesis import ThesisJoint

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
    timers: str = typer.Option(
        "", metavar="T,T,...", help="Search at these sample timers, too; the best is named."
    ),
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
        from medusa.servo.margins import margins
        from medusa.servo.position_filter import check_stable
        from medusa.servo.search import best_timer, search_filter, search_timers
        from medusa.servo.thesis import JOINTS
        from medusa.servo.trials import assess

        changes = {key: _positive(key, value) for key, value in given.items() if value is not None}
        changes |= _encoder(lines, gear)
        registers = read_bytes(options, bytes_)
        others = _timers(timers)
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
            document[name]["velocity"]["misprints"] = misprints(joint, made)
            candidates = {"thesis": made.registers}
            if registers is not None:
                check_stable(plant.at_timer(registers.timer), registers.filter)
                candidates["given"] = registers
            if search:
                candidates["searched"] = search_filter(plant, timer).registers
            if others:
                found = search_timers(plant, others)
                best = best_timer(found)
                candidates |= {"best T" if t == best else f"T = {t}": c.registers for t, c in found.items()}
            for label, bytes_of in candidates.items():
                margin = margins(plant.at_timer(bytes_of.timer), bytes_of.filter)
                tried.append(_judged(name, label, assess(plant, bytes_of), margin))
        document["bytes"] = tried
        if figures is not None:
            document["figures"] = [str(path) for path in _draw(designs, figures)]
        options.show(document, lambda: print_designs(designs, document))

    options.run(body)


def _joint(name: str) -> "ThesisJoint":
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


def _timers(text: str) -> list[int]:
    from medusa.errors import CommandError

    timers = [int(part) if part.strip().isdecimal() else 0 for part in text.split(",")] if text else []
    if not all(7 <= timer <= 255 for timer in timers):
        raise CommandError(
            f"--timers {text}: sample timers are whole numbers from 7 to 255, with commas between"
        )
    return timers


def _encoder(lines: float | None, gear: float | None) -> dict[str, float]:
    from medusa.errors import CommandError
    from medusa.servo.plant import encoder_gain

    if lines is None and gear is None:
        return {}
    if lines is None or gear is None:
        raise CommandError("--lines and --gear belong together: E = 4 N G/2π")
    return {"encoder": encoder_gain(_positive("lines", lines), _positive("gear", gear))}


def _judged(name: str, label: str, candidate: Any, margin: "ServoMargins") -> dict[str, Any]:
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
        "gain_margin": margin.gain,
        "phase_margin_deg": margin.phase_deg,
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
