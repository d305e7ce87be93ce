"""The Labmate base, emulated from its protocol page."""

from sim_devices.labmate.config import BaseConfig, Box, Bump
from sim_devices.labmate.machine import BaseMachine

__all__ = ["BaseConfig", "BaseMachine", "Box", "Bump"]
