"""The live axis without a browser: the loop, the race, the bound, and who may come in."""

import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.experiments.cli import main
from flexaxis.experiments.demo import serve
from flexaxis.experiments.demo.axis import LiveAxis
from flexaxis.experiments.demo.page import Page
from flexaxis.experiments.demo.racer import HYPOTHESES, NAMES
from flexaxis.experiments.demo.session import MARK, DemoSession
from flexaxis.experiments.demo.tracking import Change
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.timing import PERIOD, rate

RATE = rate(PERIOD)
NOMINAL = np.array([1.0, 1.25, 0.05, 0.0])


def test_the_race_is_what_the_estimator_does_alone():
    """Whatever the pieces in which the session advances, to the last bit."""
    session, axis = DemoSession(seed=1), LiveAxis(seed=1)
    for piece in (3, 50, 347):
        session.advance(piece)
    torque, speed, _ = axis.advance(400)
    alone = Rpem(
        three_mass(axis.nominal.as_dict()),
        P0=known_P(NAMES, forgetting=0.995),
        forgetting=0.995,
        period=PERIOD,
    )
    expected = alone.run(torque, speed)
    np.testing.assert_array_equal(session.curves()["theta"][:, 0, :3], expected[MARK - 1 :: MARK])


def test_estimators_read_an_encoder():
    """The readings are whole counts; both restart, find the fault, and keep above the bound."""
    session = DemoSession()
    session.advance(5 * RATE)
    session.do("set_sensor", "encoder, 2048 counts")
    step = 2 * np.pi / 2048
    assert session.axis.variance == pytest.approx(step**2 / 12)
    session.advance(8 * RATE)
    counts = session._recent[1, -RATE:] / step
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    session.do("inject", "f_m", 1.5)
    session.advance(5 * RATE)
    slow, quick, single, unknown = session.changes[-1].lags
    assert 0 < single < unknown < quick < slow
    np.testing.assert_allclose(session.racers[1].theta[:3], [1.0, 1.25, 0.075], rtol=0.02)
    session.do("set_sensor", "gyroscope")
    assert "encoder, 2048 counts" in session.message


def test_both_find_a_fault_and_the_bank_says_when():
    session = DemoSession()
    session.advance(8 * RATE)
    session.do("inject", "f_m", 1.5)
    session.advance(5 * RATE)
    for racer in session.racers:
        np.testing.assert_allclose(racer.theta[:3], [1.0, 1.25, 0.075], rtol=0.05)
    (change,) = session.changes
    slow, quick, single, unknown = change.lags
    assert 0 < single < unknown < 3 * quick < slow  # known for many runs: 1.27 s
    assert slow == pytest.approx(1.27, abs=0.5)
    assert change.findings[0] == ""
    assert re.fullmatch(r"f_m × 1\.(4|5)\d* after 0\.\d+ s", change.findings[1])
    thoughts = np.array(session.racers[1].thoughts)[: RATE // 2]
    assert thoughts.max(axis=0).argmax() == HYPOTHESES.index("f_m") and thoughts.max() > 0.9


def test_a_tuning_parameter_moves_while_it_runs():
    """The estimate goes on where it was; P = (1−λ) Q⁻¹, eq. (29)."""
    session = DemoSession()
    session.advance(10 * RATE)
    session.do("inject", "f_m", 2.0)
    session.advance(10 * RATE)
    racer = session.racers[0]
    before = racer.theta, racer.deviation[0]
    session.do("tune", "A", "forgetting", 0.98)
    assert session.message == "at 20.0 s: A: forgetting 0.98"
    np.testing.assert_allclose(racer.theta, before[0], rtol=0.05)
    session.advance(5 * RATE)
    assert racer.deviation[0] / before[1] == pytest.approx(2, rel=0.3)
    for wrong in (("tune", "A", "forgetting", 1.5), ("tune", "B", "forgetting", 0.9)):
        session.do(*wrong)
        assert "forgetting" in session.message and not session.message.startswith("at ")
    assert racer.tuning["forgetting"] == 0.98
    session.do("choose", "A", "imm")
    session.advance(RATE)
    np.testing.assert_allclose(session.racers[0].theta[:3], [1.0, 1.25, 0.1], rtol=0.1)


def speeds(theta, torque, x):
    """Motor speed of the linear model from a state on, by the exponential of the whole system."""
    k_T, inverse, f_m = theta
    nominal = LiveAxis().nominal.as_dict() | {"k_T": k_T, "J_a": 1 / inverse, "f_m": f_m}
    model = three_mass(nominal).parametrize(NAMES)
    A, B, _ = model.matrices(model.theta)
    whole = np.zeros((6, 6))
    whole[:5, :5], whole[:5, 5] = A, np.ravel(B)
    step, result = expm(whole * PERIOD), []
    for u in torque:
        result.append(x[2])
        x = step[:5, :5] @ x + step[:5, 5] * u
    return np.array(result)


def test_the_bound_is_that_of_central_differences():
    """Cramér–Rao from ψ by differences of the output; prior of half the value, as in the scores."""
    axis = LiveAxis(seed=5)
    axis.advance(4 * RATE)
    axis.set_factors({"f_m": 2.0})
    change, state, noise = Change(axis, "f_m × 2", NOMINAL), axis.state, axis.noise
    torque, _, excited = axis.advance(150)
    change.take([np.tile(NOMINAL, (150, 1))] * 2, torque, excited)
    theta = np.array([1.0, 1.25, 0.1])
    psi = [
        (speeds(theta + h, torque, state) - speeds(theta - h, torque, state)) / (2 * h.max())
        for h in 1e-5 * np.diag(theta)
    ]
    for n in (20, 80, 149):
        part = np.array(psi)[:, : n + 1]
        information = np.diag(1 / (theta / 2) ** 2) + part @ part.T / noise**2
        deviations = [information[2, 2] ** -0.5, np.linalg.inv(information)[2, 2] ** 0.5]
        expected = np.minimum(1.0, np.sqrt(2 / np.pi) * np.array(deviations) / 0.05)
        np.testing.assert_allclose(change.curves[n, 2:], expected, rtol=1e-4)
    np.testing.assert_array_equal(change.curves[:, :2], 1.0)


def test_a_foreign_host_or_origin_is_refused():
    server = serve.start()
    port = server.get_port()
    try:
        with pytest.raises(FlexaxisError, match="is in use"):
            serve.start(port)
        own, page = f"http://127.0.0.1:{port}", f"ws://127.0.0.1:{port}"
        assert b"viser" in urllib.request.urlopen(own).read()
        connect(page, origin=own, proxy=None).close()
        for headers in ({"Host": "rebound.test"}, {"Host": f"rebound.test:{port}"}):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(urllib.request.Request(own, headers=headers))
        for origin in ("http://evil.test", "null", f"http://localhost:{port}"):
            with pytest.raises(InvalidStatus, match="403"):
                connect(page, origin=origin, proxy=None)
    finally:
        server.stop()


def test_a_failed_action_of_a_lesson_shows_its_reason():
    """The remark of the lesson would hide the reason; the axis keeps its valid noise."""
    server, session = serve.start(), DemoSession()
    acts = [
        {"at": 0.0, "do": "set_noise", "with": [0.2], "say": "noisier"},
        {"at": 0.02, "do": "set_noise", "with": ["loud"], "say": "louder"},
        {"at": 0.04, "do": "reset", "say": "as new"},
    ]
    try:
        page = Page(server, session, acts)
        page.advance(1)
        assert session.message == "noisier"
        page.advance(4)
        assert "louder" not in session.message and session.axis.noise == 0.2
        page.advance(4)
        assert "unknown action 'reset'" in session.message
    finally:
        server.stop()


@pytest.mark.whole
def test_a_lesson_is_served_from_the_command_line(tmp_path):
    """On this computer only, until SIGTERM, with status 0."""
    lesson = tmp_path / "lesson.toml"
    lesson.write_text('[[act]]\nat = 1.0\ndo = "inject"\nwith = ["f_m", 2.0]\nsay = "worn"\n')
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    words = ["demo", lesson, "--no-browser", "--port", port]
    command = [sys.executable, "-u", Path(sys.executable).with_name("flexaxis"), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert f"http://127.0.0.1:{port}".encode() in process.stdout.readline()
        with urllib.request.urlopen(f"http://127.0.0.1:{port}") as answer:
            assert answer.status == 200
        process.send_signal(signal.SIGTERM)
        assert process.communicate(timeout=60) == (b"", b"") and process.returncode == 0


def test_wrong_use_is_one_line_and_status_2(capsys, tmp_path, monkeypatch):
    (tmp_path / "a.toml").write_text("[[act]]\nat = 1.0\n")
    monkeypatch.setitem(sys.modules, "mjviser", None)
    for words, message in (
        ([str(tmp_path / "a.toml")], "needs the keys `at` and `do`"),
        (["--estimator", "ekf"], "the demo needs 2 estimators"),
        (["--port", "80000"], "choose a port from 1 to 65535"),
        (["--no-browser"], "pip install -e '.[demo]'"),
    ):
        assert main(["demo", *words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert message in line
