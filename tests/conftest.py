"""Fixtures shared by all tests."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

SHARED_FOLDER = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20261124)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of recorded and published data that lies beside some checkouts."""
    folder = SHARED_FOLDER / "data"
    if not folder.is_dir():
        pytest.skip("needs the shared data folder beside the checkout")
    return folder
