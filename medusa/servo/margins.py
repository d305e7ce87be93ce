"""Gain and phase margin of the position loop, for one filter exactly and for many on a grid of frequencies."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medusa.servo.plant import DiscretePlant
from medusa.servo.position_filter import Filter

GRID = 200
"""Frequencies from 1/100 of the Nyquist frequency up: margins read on them err by less than 2 %."""


@dataclass(frozen=True)
class ServoMargins:
    """Stability margins of the loop D(z) P(z)."""

    gain: float
    """Factor by which the loop gain may grow; infinite when the phase never crosses −180°."""
    phase_deg: float
    distance: float
    """Least distance of the locus from −1: the inverse of the peak sensitivity."""
    crossover_hz: float


def margins(plant: DiscretePlant, controller: Filter) -> ServoMargins:
    """Margins of one loop by python-control."""
    import control

    loop = controller.transfer_function(plant.period) * plant.position()
    with warnings.catch_warnings():
        # It evaluates the loop at its own pole z = 1, too.
        warnings.simplefilter("ignore", RuntimeWarning)
        gain, phase, distance, _, crossover, _ = control.stability_margins(loop)
    return ServoMargins(float(gain), float(phase), float(distance), float(crossover) / (2 * np.pi))


def grid_margins(
    plant: DiscretePlant, zero: ArrayLike, pole: ArrayLike, gain: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(gain margin, phase margin in degrees) of many filters; A, B and K as numbers, shapes (n,) to (n,).

    Read on a grid of frequencies. A loop that is unstable may still show margins: poles are a separate question.
    """
    a, b, k = (np.asarray(x, dtype=np.float64)[:, None] for x in (zero, pole, gain))
    parts = [
        _grid_part(plant, a[i : i + 2048], b[i : i + 2048], k[i : i + 2048]) for i in range(0, len(a), 2048)
    ]
    if not parts:
        return np.empty(0), np.empty(0)
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _grid_part(
    plant: DiscretePlant, a: NDArray[np.float64], b: NDArray[np.float64], k: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    z = np.exp(1j * np.geomspace(np.pi / 100, np.pi, GRID))
    process = plant.gain * (z + plant.zero) / ((z - 1) * (z - plant.pole))
    loop = k * (z - a) / (z + b) * process
    size = np.abs(loop)
    phase = np.unwrap(np.angle(loop), axis=1)
    crossing_gain = (size[:, :-1] > 1) & (size[:, 1:] <= 1)
    crossing_phase = (phase[:, :-1] > -np.pi) & (phase[:, 1:] <= -np.pi)
    phase_margin = np.where(crossing_gain, phase[:, 1:] + np.pi, np.inf).min(axis=1)
    gain_margin = np.where(crossing_phase, 1 / size[:, 1:], np.inf).min(axis=1)
    return gain_margin, np.degrees(phase_margin)
