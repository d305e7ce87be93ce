"""What every mobile base has to do: one body of tests, over any driver. Tolerances come from its capabilities.

A base subclasses `MobileBaseContract` as a `Test…` class and gives `machine()`. An incident that it cannot have is
named in `lacks`; what needs it is skipped by that name.
"""

from labmate.testing.fault_promises import FaultPromises
from labmate.testing.motion_promises import MotionPromises
from labmate.testing.stop_promises import StopPromises
from labmate.testing.world import INCIDENTS, Truth, World

__all__ = ["INCIDENTS", "MobileBaseContract", "Truth", "World"]


class MobileBaseContract(StopPromises, MotionPromises, FaultPromises):
    """All promises; a subclass gives `machine`."""
