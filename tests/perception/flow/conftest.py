"""Sixty textures that were used to choose nothing, moved exactly in the frequency domain."""

import pytest

from tools.flow.textures import Texture


@pytest.fixture(scope="session")
def textures():
    return [Texture(seed) for seed in range(3000, 3060)]
