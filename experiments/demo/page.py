"""The web page of the demo: the axis in 3-D, buttons, sliders, plots and tables."""

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.demo.axis import EXCITATION, FRICTION, SENSORS
from flexaxis.experiments.demo.racer import HYPOTHESES, SHOWN, TUNING
from flexaxis.experiments.demo.session import BUTTONS, MARK, DemoSession
from flexaxis.experiments.demo.tracking import LENGTH, Change
from flexaxis.experiments.demo.view import exaggerated, scene
from flexaxis.experiments.reporting.styles import NINE
from flexaxis.experiments.reporting.tables import short
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]

COLOURS = [style.light for style in NINE]
A, B = zip("AB", COLOURS, strict=False)
RUN, PAUSE, STEP = "Run", "Pause", f"Step {MARK * PERIOD:g} s"
EDGE = "± 2σ"
SHARE = {"range": (0.0, 1.1)}
SINCE = {"time": False, "distr": 3, "range": (PERIOD, LENGTH * PERIOD)}
TWIST = 100.0
"""Magnification of the joint twist in the 3-D drawing."""
LATEST = 8
"""Number of parameter changes in the table; the latest change comes first."""


class Page:
    """The web page of a demo session; a lock keeps user actions from interrupting the simulation.

    Parameters
    ----------
    server : viser.ViserServer
        Server that displays the web page.
    session : DemoSession
        Session that the web page shows and controls.
    acts : list of dict
        Timed actions of a lesson, as returned by `flexaxis.experiments.demo.serve.load_lesson`.

    Attributes
    ----------
    paused : bool
        Whether a user has paused the simulation.
    steps : int
        Number of single steps that a user has requested and that are still pending. A single step
        consists of `MARK` samples.
    """

    def __init__(self, server: Any, session: DemoSession, acts: list[dict[str, Any]]) -> None:
        from mjviser import ViserMujocoScene

        self._server, self._session, self._acts = server, session, acts
        self._lock, self.paused, self.steps = threading.Lock(), False, 0
        self._engine = scene()
        self._scene = ViserMujocoScene(server, self._engine[1], num_envs=1)
        self._scene.camera_tracking_enabled = False
        server.initial_camera.position = (1.1, -1.7, 1.5)
        server.initial_camera.look_at = (0.1, 0.0, 0.45)
        self._add_controls()
        self._add_curves()

    def advance(self, samples: int) -> None:
        """Simulate the next samples, and then perform all lesson actions that are due."""
        with self._lock:
            self._session.advance(samples)
            while self._acts and self._acts[0]["at"] <= self._session.axis.time:
                act = self._acts.pop(0)
                if self._session.do(act["do"], *act.get("with", ())):
                    self._session.message = act.get("say", self._session.message)

    def draw_axis(self) -> None:
        """Draw the axis at its current angles."""
        mujoco, model, data = self._engine
        axis = self._session.axis
        data.qpos[:] = exaggerated(axis.angles, ratio=axis.nominal.r, exaggerate=TWIST)
        mujoco.mj_kinematics(model, data)
        with self._server.atomic():
            self._scene.update_from_mjdata(data)

    def draw_curves(self) -> None:
        """Update the plots, the clock and the tables on the web page."""
        with self._lock:
            session, curves = self._session, self._session.curves()
            clock = f"**t = {session.axis.time:.1f} s**{' · paused' * self.paused}"
            self._clock.content = f"{clock} · {session.message}"
            self._now.content = _values(session)
            self._changes.content = _changes(session.changes)
            errors = session.changes[-1].curves if session.changes else np.empty((0, 4))
            thoughts = np.empty((0, len(HYPOTHESES)))
            for racer in session.racers:
                thoughts = np.array(racer.thoughts or thoughts)
        self._left.data, self._bank.data = _since(errors), _since(thoughts)
        for plot, truth, theta, deviation in zip(
            self._estimates,
            *(curves[name].T for name in ("truth", "theta", "deviation")),
            strict=True,
        ):
            edges = 2 * deviation * np.array([0.0, 1.0, -1.0])[:, None, None]
            plot.data = curves["time"], truth, *np.concatenate((theta + edges).transpose(1, 0, 2))

    def _add_controls(self) -> None:
        gui, session = self._server.gui, self._session
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(440)
        gui.set_panel_label(f"flexaxis: break it! (twist shown × {TWIST:g})")
        sheet = (files("flexaxis.experiments.demo") / "page.css").read_text(encoding="utf-8")
        gui.add_html(f"<style>{sheet}:root {{ --a: {A[1]}; --b: {B[1]}; }}</style>")
        acts: Any = {label: ("inject", *fault) for label, fault in BUTTONS.items()}
        acts["Repair everything"] = ("repair",)
        faults = gui.add_button_group("faults", [*acts])
        faults.on_click(lambda _: self._do(*acts[faults.value]))
        clock = gui.add_button_group("clock", [RUN, PAUSE, STEP])
        clock.on_click(lambda _: self._wind(clock.value))
        self._clock, self._now = gui.add_markdown(""), gui.add_html("")
        bounds = ("bound, known parameter", COLOURS[3]), ("unknown", COLOURS[4])
        self._left = _plot(gui, "error after the last change", (A, B, *bounds), x=SINCE, y=SHARE)
        self._changes = gui.add_html("")
        with gui.add_folder("Axis: noise, excitation, friction, sensor", expand_by_default=False):
            noise = gui.add_slider("noise [rad/s]", 0.0, 0.5, 0.01, session.axis.noise)
            self._on(noise, "set_noise")
            self._on(gui.add_dropdown("excitation", EXCITATION), "set_excitation")
            self._on(gui.add_dropdown("friction", [*FRICTION]), "set_friction")
            self._on(gui.add_dropdown("sensor", [*SENSORS]), "set_sensor")
        for letter, racer in zip("AB", session.racers, strict=True):
            with gui.add_folder(f"Estimator {letter}: choice, λ, Δ, μ", expand_by_default=False):
                names = dict.fromkeys([racer.text, *(n for n in REGISTRY if n != "oracle-reset")])
                choice = gui.add_dropdown("estimator", [*names])
                sliders = {key: gui.add_slider(*look, look[1]) for key, look in TUNING.items()}
                show = partial(self._show, letter, sliders)
                self._on(choice, "choose", letter, then=show)
                for option, slider in sliders.items():
                    self._on(slider, "tune", letter, option)
                show()

    def _add_curves(self) -> None:
        gui = self._server.gui
        panel = gui.add_panel()
        with panel.add_tab("Curves"):
            lines = [("truth", "#222222")]
            for letter, colour in (A, B):
                lines += [(letter, colour), (EDGE, colour), (EDGE, colour)]
            self._estimates = [_plot(gui, name, lines) for name in SHOWN]
            hypotheses = [*zip(HYPOTHESES, COLOURS, strict=False)]
            title = "hypotheses: probability of a change"
            self._bank = _plot(gui, title, hypotheses, x=SINCE, y=SHARE)
        panel.dock_left()
        panel.set_width(390)

    def _on(
        self, control: Any, action: str, *values: str, then: Callable[[], None] = lambda: None
    ) -> None:
        """Call an action of the session whenever a user sets a control to an allowed value."""

        def act(event: Any) -> None:
            value = control.value
            if event.client and value in getattr(control, "options", [value]):
                self._do(action, *values, value)
                then()

        control.on_update(act)

    def _do(self, action: str, *values: Any) -> None:
        with self._lock:
            self._session.do(action, *values)

    def _show(self, letter: str, sliders: Mapping[str, Any]) -> None:
        """Show a slider with the current value for each tunable option of an estimator."""
        tuning = self._session.racers["AB".index(letter)].tuning
        for option, slider in sliders.items():
            slider.visible = option in tuning
            slider.value = tuning.get(option, slider.value)

    def _wind(self, label: str) -> None:
        self.paused, self.steps = label != RUN, self.steps + (label == STEP)


def _plot(gui: Any, title: str, lines: Sequence[tuple[str, str]], **scales: Any) -> Any:
    """Add a plot of labelled, coloured lines; a plot with six or more lines has no legend."""
    series = [
        {"label": label, "stroke": colour, "width": 0.5 if label == EDGE else 1.5}
        for label, colour in lines
    ]
    return gui.add_uplot(
        (np.zeros(1),) * (len(lines) + 1),
        ({"label": "s"}, *series),
        title=title,
        scales={"x": {"time": False}} | scales,
        legend={"show": len(lines) < 6},
        height=150,
    )


def _since(values: Array) -> tuple[Array, ...]:
    """Return the plot data: the times since a change, and the columns of the array `values`."""
    return (PERIOD * np.arange(1.0, len(values) + 1), *values.T)


def _table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return an HTML table with one heading per column."""
    lines = ["".join(f"<{tag}>{escape(text)}</{tag}>" for text in row)
             for tag, row in (("th", heads), *(("td", row) for row in rows))]  # fmt: skip
    return f"<table class='demo'>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _values(session: DemoSession) -> str:
    """Return an HTML table of true parameter values and estimates."""
    heads, columns = ["", "truth"], [session.axis.theta(SHOWN)]
    for letter, racer in zip("AB", session.racers, strict=True):
        heads.append(f"{letter}: {racer.text}")
        columns.append(racer.shown(racer.theta))
    rows = [
        [name, *(f"{value:.4g}".replace("nan", "–") for value in values)]
        for name, *values in zip(SHOWN, *columns, strict=True)
    ]
    return _table(heads, rows)


def _changes(changes: Iterable[Change]) -> str:
    """Return an HTML table of the latest parameter changes, with lags, bounds and detections."""
    rows = []
    for change in [*changes][: -LATEST - 1 : -1]:
        *lags, single, unknown = map(short, change.lags)
        racers = [
            f"{lag}{' …' * change.open} {finding}"
            for lag, finding in zip(lags, change.findings, strict=True)
        ]
        rows.append([f"{change.at * PERIOD:.1f}", change.what, *racers, f"{single} – {unknown}"])
    return _table(["t [s]", "change", "A: lag [s], detection", "B", "bound [s]"], rows)
