"""From a measured plant to filter bytes, and those into board and configuration."""

from collections.abc import Sequence
from dataclasses import dataclass

from medusa.errors import CommandError, DeviceFault
from medusa.head.joint_group import JointGroup
from medusa.mc3000.board import FilterBytes, Mode
from medusa.mc3000.drive import Mc3000Drive
from medusa.mc3000.plant_measurement import Excitation, measure_plant
from medusa.servo.identification import Identification
from medusa.servo.position_filter import FilterRegisters, check_stable
from medusa.servo.search import search_filter
from medusa.servo.trials import Candidate, assess, thesis_registers
from medusa.servo.velocity import check_velocity_stable, design_velocity_register


@dataclass(frozen=True)
class Tuning:
    """A joint's plant, the bytes chosen for it, and those of the thesis's method beside them."""

    axis: str
    identified: Identification
    chosen: Candidate
    thesis: Candidate
    velocity_register: int
    velocity_timer: int

    @property
    def registers(self) -> FilterRegisters:
        """Bytes for the position, profile and integral velocity modes."""
        return self.chosen.registers

    @property
    def keys(self) -> dict[str, int]:
        """Keys of the configuration and their new values."""
        r = self.registers
        position = {"A": r.zero, "B": r.pole, "K": r.gain, "T": r.timer}
        velocity = {"A": 0, "B": 0, "K": self.velocity_register, "T": self.velocity_timer}
        chosen = {"position": position, "integral_velocity": position, "proportional_velocity": velocity}
        return {
            f"axes.{self.axis}.filters.{mode}.{letter}": value
            for mode, bytes_ in chosen.items()
            for letter, value in bytes_.items()
        }


def choose_filter(
    identified: Identification, name: str, timer: int, registers: FilterRegisters | None = None
) -> Tuning:
    """The searched bytes, or `registers` if they are stable, on a measured plant at a sample timer.

    Raises CommandError for unstable bytes, and when no bytes meet the search's criterion.
    """
    plant = identified.plant
    if registers is not None:
        check_stable(plant.at_timer(registers.timer), registers.filter)
        timer = registers.timer
    theirs = thesis_registers(plant, timer)
    velocity = design_velocity_register(plant, timer)
    check_velocity_stable(plant.at_timer(timer), velocity / 4)
    return Tuning(
        axis=name,
        identified=identified,
        chosen=search_filter(plant, timer) if registers is None else assess(plant, registers),
        thesis=assess(plant, theirs),
        velocity_register=velocity,
        velocity_timer=timer,
    )


async def tune_axes(
    group: JointGroup,
    names: Sequence[str],
    *,
    timer: int | None = None,
    registers: FilterRegisters | None = None,
    excitation: Excitation | None = None,
) -> list[Tuning]:
    """Identify joints, disable the head, and choose their filter bytes; nothing is written.

    `timer`: the sample timer, the configured one when None. What `measure_plant` and `choose_filter` raise.
    """
    drive = Mc3000Drive.of(group)
    identified = {name: await measure_plant(group, name, excitation) for name in names}
    # The search computes for seconds, in which nobody would feed a watchdog: the head is switched off for it.
    await group.disable()
    return [
        choose_filter(
            found, name, drive.axes[name].config.filters.position.T if timer is None else timer, registers
        )
        for name, found in identified.items()
    ]


async def write_filter(group: JointGroup, tuning: Tuning) -> None:
    """Write the position filter to the board, the joint idle, and read it back.

    Raises CommandError when the joint is not idle, DeviceFault when the board holds other bytes.
    """
    axis = Mc3000Drive.of(group).axes[tuning.axis]
    if axis.mode is not Mode.IDLE:
        raise CommandError(
            f"{tuning.axis}: a filter is written in idle only, it is in {axis.mode.name.lower()}"
        )
    r = tuning.registers
    wanted = FilterBytes(r.zero, r.pole, r.gain, r.timer)
    await axis.board.filter(axis.channel, wanted)
    held = await axis.board.read_filter(axis.channel)
    if held != wanted:
        raise DeviceFault(f"{tuning.axis}: wrote {wanted}, the board holds {held}", axis=tuning.axis)
