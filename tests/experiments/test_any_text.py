"""Any text in place of a scenario or a log gives a result or a FlexaxisError."""

from contextlib import suppress

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.importing import import_log
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import parse_scenario

SCENARIO = find_scenario("coulomb_fm_step-v1")
ROWS = "\n".join(f"{k / 200},{np.sin(k):.4f},{np.cos(k):.4f}" for k in range(300))
LOG = f"time [s],torque [Nm],speed [rad/s]\n{ROWS}\n"

PIECES = st.text(max_size=8) | st.sampled_from(
    [",", ";", "\n", "\t", "#", '"', "nan", "1e999", "-", "[", "]", "=", "2026-01-01T00:00:00"]
)
FEW = settings(
    max_examples=20,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@st.composite
def edited(draw, text):
    """Return a text in which some pieces are replaced by others."""
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(text)))
        stop = min(len(text), start + draw(st.integers(0, 20)))
        text = text[:start] + draw(PIECES) + text[stop:]
    return text


@FEW
@given(text=edited(SCENARIO.to_toml()) | st.text())
def test_text_of_a_scenario(text):
    with suppress(FlexaxisError):
        assert parse_scenario(text).duration > 0


@FEW
@given(text=edited(LOG) | st.text())
@example(text="")
@example(text='"')
@example(text="time,torque,speed\n" + "1,2,3\n" * 300)
def test_text_of_a_log(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8", errors="replace")
    with suppress(FlexaxisError):
        record = import_log(path, torque_is="held").record
        assert np.isfinite(record.time).all() and len(record.time) > 1
