"""The contract of a drive, for whoever writes one; needs pytest."""

import pytest

pytest.register_assert_rewrite(
    "medusa.testing.bench",
    "medusa.testing.confirmation_promises",
    "medusa.testing.motion_promises",
    "medusa.testing.opened",
    "medusa.testing.stop_promises",
)
