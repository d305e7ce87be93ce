"""The bases there are, one row a machine, and how a program opens the one that its configuration names."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Final

from labmate.base.mobile_base import MobileBase
from labmate.config import BaseConfig, CalibrationFile, Machine, OdometryConfig, read_calibration
from labmate.driver.labmate import Labmate
from labmate.odometry import OdometryNoise
from medusa.link import Line, Trace
from medusa.link.contact import seconds_suspended

Opener = Callable[..., AbstractAsyncContextManager[MobileBase]]


@asynccontextmanager
async def _open_labmate(
    path: str,
    config: BaseConfig | None,
    calibration: CalibrationFile | None,
    *,
    trace: Trace | None,
    poll_period: float,
    seed: int | None,
    name: str,
    suspended: Callable[[], float],
) -> AsyncIterator[MobileBase]:
    baud = 115200 if config is None else config.port.baud
    async with Line(path, baud=baud, trace=trace, name="labmate", seed=seed, suspended=suspended) as line:
        driver = Labmate(line, config, path=name, calibration=calibration)
        async with MobileBase(
            driver,
            calibration=None if calibration is None else calibration.value,
            noise=_noise(config, calibration),
            poll_period=poll_period,
        ) as base:
            yield base


MACHINES: Final[Mapping[Machine, Opener]] = {"labmate": _open_labmate}


def open_base(
    path: str,
    config: BaseConfig | None,
    *,
    calibration: CalibrationFile | None = None,
    trace: Trace | None = None,
    poll_period: float = 0.25,
    seed: int | None = None,
    name: str | None = None,
    suspended: Callable[[], float] = seconds_suspended,
) -> AbstractAsyncContextManager[MobileBase]:
    """Open a line with one base on it, and the base; leaving it leaves the base at rest, confirmed.

    Without a configuration it is a Labmate that can be read and stopped, not moved. `name`: what messages call it
    (default: the path). `seed`: for repeatable runs against an emulator. `suspended`: as in `Line`. Raises
    ConfigError (the configured calibration), PortError, NoReply.
    """
    if calibration is None and config is not None and config.calibration_path is not None:
        calibration = read_calibration(config.calibration_path)
    return MACHINES["labmate" if config is None else config.machine](
        path,
        config,
        calibration,
        trace=trace,
        poll_period=poll_period,
        seed=seed,
        name=name or path,
        suspended=suspended,
    )


def _noise(config: BaseConfig | None, calibration: CalibrationFile | None) -> OdometryNoise:
    uncertainty = OdometryConfig() if config is None else config.odometry
    if calibration is None:
        return uncertainty.uncalibrated
    return calibration.value.noise(uncertainty.wheel_noise)
