"""What every drive promises, as tests: subclass `DriveContract`, say how a machine is opened, and run pytest.

Tolerances come from the drive's capabilities and traits; truth comes from outside the drive. An incident that a
machine cannot stage is left out of its mapping, and the tests of it are skipped by name.
"""

from medusa.testing.bench import Machine
from medusa.testing.confirmation_promises import ConfirmationPromises
from medusa.testing.motion_promises import MotionPromises
from medusa.testing.stop_promises import StopPromises

__all__ = ["DriveContract", "Machine"]


class DriveContract(MotionPromises, StopPromises, ConfirmationPromises):
    """All promises; a subclass overrides `machine`."""
