"""A picture of the axis, as on a computer without a display."""

import os
import subprocess
import sys

import pytest

from flexaxis.experiments.demo import view
from flexaxis.experiments.demo.view import draw_offscreen
from flexaxis.sim.errors import FlexaxisError

HIDDEN = {"DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"}


@pytest.mark.slow
def test_a_picture_needs_no_display(tmp_path):
    target = tmp_path / "axis.png"
    code = f"import flexaxis as fx; print(fx.view('fm_step-v1', at=12, picture={str(target)!r}))"
    environment = {key: value for key, value in os.environ.items() if key not in HIDDEN}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if "neither libEGL nor libOSMesa is installed" in done.stderr:
        pytest.skip(done.stderr)
    assert (done.returncode, done.stdout.strip()) == (0, str(target)), done.stderr
    assert target.read_bytes().startswith(b"\x89PNG") and target.stat().st_size > 5000


@pytest.fixture
def bare(monkeypatch):
    """No display, no choice made; the test says which libraries there are."""
    monkeypatch.setattr(view.sys, "platform", "linux")
    for name in HIDDEN:
        monkeypatch.setenv(name, "")  # so that it is put back as it was
        monkeypatch.delenv(name)

    def chosen(*libraries, **environment):
        monkeypatch.setattr(view, "find_library", lambda name: name in libraries or None)
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        draw_offscreen()
        return os.environ.get("MUJOCO_GL")

    return chosen


@pytest.mark.parametrize(
    ("libraries", "way"),
    [(("EGL", "OSMesa"), "egl"), (("EGL",), "egl"), (("OSMesa",), "osmesa")],
)
def test_the_best_way_that_there_is(bare, libraries, way):
    assert bare(*libraries) == way


def test_no_way_at_all_is_said(bare):
    with pytest.raises(FlexaxisError, match="neither libEGL nor libOSMesa is installed"):
        bare()
