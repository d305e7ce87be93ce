"""The contracts' assertions explain themselves as those of a test module do."""

import pytest

pytest.register_assert_rewrite(
    *(
        f"labmate.testing.{module}"
        for module in ("world", "opened_base", "stop_promises", "motion_promises", "fault_promises")
    )
)
