"""Lessons: what is read, what is refused, what is drawn."""

import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.demo.lesson import (
    LessonError,
    Player,
    load_lesson,
    parse_lesson,
)
from flexaxis.experiments.demo.session import DemoSession

SHORT = """
title = "short"
duration = 4.0
speed = 4.0
frames = 5
[[act]]
at = 2.0
fault = "f_m"
factor = 2.0
say = "worn"
[[act]]
at = 1.0
racer = "B"
drift = {f_m = 1e-7}
regularization = 0.1
noise = 0.0
"""


@pytest.fixture
def recorded(tmp_path):
    """Record the short lesson in a process of its own, as on a computer without a display."""

    def record(name):
        script, target = tmp_path / "short.toml", tmp_path / name
        script.write_text(SHORT, encoding="utf-8")
        command = [sys.executable, "-m", "flexaxis.experiments.cli", "demo", "--record", target]
        hidden = {"DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"}
        environment = {key: value for key, value in os.environ.items() if key not in hidden}
        done = subprocess.run(
            [*command, script],
            capture_output=True,
            text=True,
            check=False,
            env=environment,
        )
        if "no picture can be drawn here" in done.stderr:
            pytest.skip(done.stderr.splitlines()[-1])
        assert (done.returncode, done.stdout.strip()) == (0, str(target)), done.stderr
        return target

    return record


def test_the_default_lesson_can_be_played():
    lesson = load_lesson(None)
    session = DemoSession(estimators=lesson.estimators)
    for act in lesson.act:
        act.do(session)
    assert session.factors == {"f_m": 2.0, "J_a": 1.25, "k_T": 0.9}


def test_all_problems_are_said_at_once():
    text = (
        'titel = "a"\nduration = -1.0\n'
        '[[act]]\nat = "soon"\nfalt = "f_m"\n'
        '[[act]]\nat = 1.0\nfault = "f_m"\n'
    )
    with pytest.raises(LessonError) as problem:
        parse_lesson(text, source="mine.toml")
    lines = str(problem.value).splitlines()
    assert len(lines) == 5 and all(line.startswith("mine.toml: ") for line in lines)
    assert "Did you mean 'title'" in str(problem.value)
    assert "Did you mean 'fault'" in str(problem.value)
    assert "fault and factor go together" in str(problem.value)


@pytest.mark.parametrize(
    ("act", "problem"),
    [
        ('fault = "f_n"\nfactor = 2.0', "act[0].fault: unknown parameter 'f_n'"),
        ('fault = "r"\nfactor = 2.0', "act[0].fault: unknown parameter 'r'"),
        ('fault = "f_m"\nfactor = 3.0', "act[0].factor: must be less than or equal to 2"),
        ("f_c = 3.0", "act[0].f_c: must be less than or equal to 0.4"),
        ("f_c = 0.0", "act[0].f_c: must be greater than or equal to 0.01"),
        ("v_s = nan", "act[0].v_s: must be "),
        ('friction = "coulomb"', "act[0].friction: unknown friction"),
        ('excitation = "of"', "act[0].excitation: unknown excitation"),
        ("forgetting = 1.5", "act[0].forgetting: must be less than or equal to 1"),
        ("drift = {f_n = 1e-7}", "act[0].drift: unknown parameter"),
        ("drift = {f_m = 0.0}", "act[0].drift.f_m: must be greater than 0"),
        ('racer = "A"\nestimator = "ekg"', "act[0].estimator: unknown estimator 'ekg'"),
        ('racer = "A"\nestimator = "ekf[a=1]"', "act[0].estimator: ekf has no option 'a'"),
        ('racer = "A"\nestimator = "rpem-drift[scale=\'x\']"', "act[0].estimator: "),
        ('racer = "A"\nestimator = "ekf[output=\'position\']"', "act[0].estimator: "),
    ],
)
def test_what_the_axis_would_refuse_is_said_when_the_lesson_is_read(act, problem):
    wrong = f"[[act]]\nat = 1.0\n{act}\n[[act]]\nat = -1.0\n"
    with pytest.raises(LessonError) as found:
        parse_lesson(wrong, source="mine.toml")
    first, second = str(found.value).splitlines()
    assert first.startswith(f"mine.toml: {problem}")
    assert second.startswith("mine.toml: act[1].at: ")


class Stubborn(DemoSession):
    """A session in which nothing can be broken."""

    def inject(self, parameter, factor):
        raise RuntimeError("it does not break")


def test_an_act_that_fails_does_not_stop_a_live_lesson():
    lesson = parse_lesson(SHORT, source="short")
    session, lines = Stubborn(), []
    Player(session, lesson, lines.append).advance(500)
    assert session.axis.samples == 500 and session.axis.noise == 0, "the other act is done"
    assert lines == ["act[0] at 2 s cannot be done: it does not break"] == [session.said]
    with pytest.raises(LessonError, match=r"act\[0\] at 2 s cannot be done"):
        Player(Stubborn(), lesson).advance(500)


@pytest.mark.slow
def test_a_recording_has_the_pictures_of_the_lesson(recorded):
    from PIL import Image

    target = recorded("short.gif")
    with Image.open(target) as movie:
        assert movie.n_frames == 5  # 4 s at four times real time, five pictures a second
        assert movie.info["duration"] == 200
        pictures = []
        for number in range(movie.n_frames):
            movie.seek(number)
            pictures.append(np.asarray(movie.convert("RGB")).astype(int))
    changed = [np.abs(b - a).max(axis=2) > 40 for a, b in pairwise(pictures)]
    curves = [change[:, 420:].sum() for change in changed]
    assert min(curves) > 0, "the curves go on"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--record", "a.avi"], "a recording is a .gif file"),
        (["--record", "a.gif", "none.toml"], "none.toml: cannot be read"),
        (["--speed", "0"], "--speed 0: give a factor"),
        (["--record", "a.gif", "--estimator", "ekf"], "two estimators race, not 1"),
        (["--record", "a.gif", "--estimator", "ekf", "--estimator", "ekg"], "Did you mean 'ekf'"),
        (["--record", "no/such/folder/a.gif"], "there is no folder no/such/folder"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(words, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", *words]) == 2
    (line,) = [text for text in capsys.readouterr().err.splitlines() if "flexaxis:" in text]
    assert message in line
