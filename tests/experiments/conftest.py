"""A short scenario, so that a whole run takes a second."""

import pytest

from flexaxis.experiments.catalogue.find import find_scenario

SHORT = {
    "name": "short",
    "duration": 8.0,
    "burn_in": 1.0,
    "fault": [{"kind": "step", "parameter": "f_m", "at": 6.0, "factor": 1.5}],
}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Tests neither fill nor read the user's cache of records."""
    monkeypatch.setenv("FLEXAXIS_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="session")
def short():
    """f_m +50 % at 6 of 8 s."""
    return find_scenario("fm_step-v1").override(SHORT)


@pytest.fixture
def short_toml(short, tmp_path):
    """The same as a file."""
    path = tmp_path / "short.toml"
    path.write_text(short.to_toml(), encoding="utf-8")
    return path
