"""Async tests run in virtual time: the loop's clock jumps to the next timer when nothing is ready."""

import asyncio
from collections.abc import Callable, Mapping

import pytest

from sim_devices.clock import VirtualTimeLoop


def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    if item.get_closest_marker("real_time"):
        return {"real": asyncio.new_event_loop}
    return {"virtual": VirtualTimeLoop}
