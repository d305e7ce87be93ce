"""The guard of the soft limits, over the ideal drive: which readings count."""

from medusa.config.file import parse_config
from medusa.head.drive import Reading
from medusa.head.velocity_guard import VelocityGuard
from medusa.ideal.config import IdealConfig, template
from medusa.ideal.drive import IdealDrive


async def test_a_reading_from_before_a_stop_is_read_anew_before_a_rate() -> None:
    config = parse_config(template(), "the template")
    assert isinstance(config, IdealConfig)
    drive = IdealDrive(config.traits)
    guard = VelocityGuard(drive)
    name = next(iter(drive.traits))
    before = await drive.read()
    guard.forget()
    guard.take_reading(before)
    asked = 0
    read = drive.read

    async def count(names: object = None) -> Reading:
        nonlocal asked
        asked += 1
        return await read()

    drive.read = count  # type: ignore[method-assign]
    await guard.without_margin({name: drive.traits[name].rate_step})
    assert asked == 1
    await guard.without_margin({name: drive.traits[name].rate_step})
    assert asked == 1


async def test_a_joint_that_still_has_its_old_rate_has_the_margin_of_that_rate() -> None:
    config = parse_config(template(), "the template")
    assert isinstance(config, IdealConfig)
    drive = IdealDrive(config.traits)
    guard = VelocityGuard(drive)
    name = next(iter(drive.traits))
    fast = 0.5 * drive.traits[name].speed
    guard.take_reading(await drive.read())
    guard.take_rates({name: fast})
    assert guard.stopping_margin(name, fast) < guard.stopping_margin(name, -0.1 * fast)
    assert guard.stopping_margin(name, 0.1 * fast) == guard.stopping_margin(name, fast)
    await guard.end()
