"""The page: the axis in 3-D, buttons, knobs, curves and history, for any number of viewers."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from flexaxis.experiments.demo.charts import Charts
from flexaxis.experiments.demo.chase import Chase
from flexaxis.experiments.demo.knobs import Bench, FrictionKnobs, Knobs, add_axis_knobs
from flexaxis.experiments.demo.offers import Offers
from flexaxis.experiments.demo.racer import NAMES
from flexaxis.experiments.demo.session import BUTTONS, MARK, DemoSession
from flexaxis.experiments.demo.words import estimates_table, history_table
from flexaxis.experiments.reporting.view import exaggerated, scene
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.timing import PERIOD

BREAK, CLOCK = "break it", "clock"
REPAIR = "Repair everything"
RUN, PAUSE, STEP = "Run", "Pause", f"Step {MARK * PERIOD:g} s"
SAVE = "save"
NEXT_SAVE = 1.0  # s until a viewer gets another file: those that nobody reads wait in memory
SAVE_CSV, SAVE_LESSON = "Table (CSV)", "Lesson (TOML)"
WIDTH, CURVES_WIDTH = 440, 390  # pixels, of 1400
F_C_SIZE = 0.1  # N m, by which an estimate of f_c is drawn

# On a phone the controls lie over the lower part of the page, two thirds as wide as it by default;
# the axis is drawn in what they leave. A wide table scrolls by itself, and does not widen them.
# A row of buttons is small for a lecture hall.
STYLE = """
<style>
@media (max-width: 36em) {
  div[style*="width: 20em"] { width: 100% !important; }
  div[style*="max-height: 60%"] { max-height: 72% !important; }
  div[style*="inset: 0px"]:has(canvas[data-engine]) { bottom: 72% !important; }
  .mantine-ScrollArea-content { width: 100%; min-width: 0 !important; display: block !important; }
}
.mantine-Button-root[data-size="compact-xs"] { height: 28px; font-size: 13px; }
.uplot .u-title { font-size: 13px; white-space: nowrap; overflow: hidden; }
</style>
"""


@dataclass
class Pace:
    """How fast the demo runs: what was asked for, and what was reached."""

    speed: float = 1.0
    frames: float = 0.0
    reached: float = 0.0
    load: float = 0.0
    paused: bool = False
    steps: int = 0


class Page:
    """Everything on the page, and the lock between the viewers' clicks and the session.

    Parameters
    ----------
    server : viser.ViserServer
    session : DemoSession
    exaggerate, speed : float
        As for `serve`.
    offers : Offers
        Of the guard before the server: what is put on the page is offered there.
    """

    def __init__(
        self,
        server: Any,
        session: DemoSession,
        *,
        exaggerate: float,
        speed: float,
        offers: Offers,
    ) -> None:
        self.server, self.session, self.pace = server, session, Pace(speed)
        self._offers, self._exaggerate = offers, exaggerate
        self._advance: Callable[[int], None] = session.advance
        self._drawn = -1
        self._saved: WeakKeyDictionary[Any, float] = WeakKeyDictionary()
        self._lock = threading.Lock()
        self._build_scene()
        self._build_controls()
        self._build_curves()
        offers.refused = lambda line: setattr(session, "said", line)

    @property
    def watched(self) -> bool:
        """Whether anybody looks."""
        return bool(self.server.get_clients())

    def advance(self, samples: int) -> None:
        """Let the session go on."""
        with self._lock:
            self._advance(samples)

    def play(self, begin: Callable[[DemoSession], Callable[[int], None]]) -> None:
        """Let something else than the session say how it goes on, such as a lesson."""
        with self._lock:
            self._advance = begin(self.session)

    def stepped(self) -> int:
        """Return the samples that single steps ask for since the last call."""
        steps, self.pace.steps = self.pace.steps, 0
        return steps * MARK

    def end(self) -> None:
        """Say that the demo has ended, and take away the buttons, which do nothing any more."""
        for row in self._rows:
            row.visible = False  # a row of them cannot be greyed
        self._said.content = "**The demo has ended:** what is here stays as it was."
        self.server.flush()

    def draw_axis(self) -> None:
        """Show where the axis is."""
        axis = self.session.axis
        ratio = axis.nominal.r
        mujoco, model, data = self._engine
        data.qpos[:] = exaggerated(axis.angles, ratio=ratio, exaggerate=self._exaggerate)
        mujoco.mj_kinematics(model, data)
        with self.server.atomic():
            self._scene.update_from_mjdata(data)

    def draw_curves(self) -> None:
        """Show curves and numbers."""
        session = self.session
        with self._lock:
            curves, dots, last = session.curves(), list(session.dots), session.history.last
            texts = self._status(), estimates_table(session), history_table(session.history)
            self._chase.update(last)
            allowed = last.pursuit.allowed if last and last.pursuit else None
        for shown, text in zip((self._said, self._table, self._past), texts, strict=True):
            if shown.content != text:
                shown.content = text
        if self._drawn != session.axis.samples:
            self._charts.update(curves, dots, allowed)
            self._drawn = session.axis.samples

    def _build_scene(self) -> None:
        from mjviser import ViserMujocoScene

        self._engine = scene()
        self._scene = ViserMujocoScene(self.server, self._engine[1], num_envs=1)
        self._scene.camera_tracking_enabled = False
        self.server.initial_camera.position = (1.1, -1.7, 1.5)
        self.server.initial_camera.look_at = (0.1, 0.0, 0.45)
        self.server.scene.add_label(
            "/twist", f"twist × {self._exaggerate:g} for the eye", position=(0.45, 0.0, 1.0)
        )

    def _build_controls(self) -> None:
        gui, offers, session = self.server.gui, self._offers, self.session
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        gui.set_panel_label("flexaxis: break it, and watch who sees it first")
        gui.add_html(STYLE)
        self._faults = {button.label: button for button in BUTTONS}
        broken = offers.group(gui, BREAK, [*self._faults, REPAIR])
        broken.on_click(_clicked(self._break))
        clock = offers.group(gui, CLOCK, [RUN, PAUSE, STEP])
        clock.on_click(_clicked(self._wind))
        self._rows = broken, clock
        self._said = gui.add_markdown("")
        self._chase = Chase(gui)
        self._table = gui.add_markdown("")
        bench = Bench(gui, offers, session, self._guarded)
        with gui.add_folder("Dry friction: f_c, Stribeck, LuGre", expand_by_default=False):
            FrictionKnobs(bench)
        with gui.add_folder("Axis: speed, noise, excitation", expand_by_default=False):
            self._add_speed()
            add_axis_knobs(bench)
        for number in range(len(session.racers)):
            with gui.add_folder(
                f"Estimator {'AB'[number]}: which, λ, Δ, μ", expand_by_default=False
            ):
                Knobs(bench, number)

    def _build_curves(self) -> None:
        gui, offers, session = self.server.gui, self._offers, self.session
        panel = gui.add_panel()
        with panel.add_tab("Estimates"):
            self._charts = Charts(gui, np.array([*session.axis.theta(NAMES), F_C_SIZE]))
        with panel.add_tab("What was done"):
            saved = offers.group(gui, SAVE, [SAVE_CSV, SAVE_LESSON])
            saved.on_click(self._save)
            self._past = gui.add_html("")
        panel.dock_left()
        panel.set_width(CURVES_WIDTH)

    def _add_speed(self) -> None:
        wanted = self.pace.speed
        slowest, fastest = min(0.25, wanted), max(10.0, wanted)
        pace = self._offers.slider(self.server.gui, "speed ×", slowest, fastest, 0.05, wanted)
        pace.on_update(lambda _: setattr(self.pace, "speed", float(pace.value)))

    def _break(self, label: str) -> None:
        if label == REPAIR:
            self._guarded(self.session.repair)()
        else:
            button = self._faults[label]
            self._guarded(self.session.inject)(button.parameter, button.factor)

    def _wind(self, label: str) -> None:
        self.pace.paused = label != RUN
        self.pace.steps += label == STEP

    async def _save(self, event: Any) -> None:
        """Send what was done to who asked for it; no name or text of a viewer is in it."""
        now, before = time.monotonic(), self._saved.get(event.client, -NEXT_SAVE)
        if now - before < NEXT_SAVE:
            return
        self._saved[event.client] = now
        lesson = event.target.value == SAVE_LESSON
        with self._lock:
            text = self.session.lesson() if lesson else self.session.history.csv()
        name = "flexaxis_lesson.toml" if lesson else "flexaxis_history.csv"
        event.client.send_file_download(name, text.encode(), save_immediately=True)

    def _guarded(self, act: Callable[..., None]) -> Callable[..., None]:
        """Let a click act on the session alone, and tell what was wrong instead of failing."""

        def guarded(*args: Any) -> None:
            with self._lock:
                try:
                    act(*args)
                except (ValueError, FlexaxisError) as error:
                    self.session.said = str(error)

        return guarded

    def _status(self) -> str:
        axis, pace = self.session.axis, self.pace
        head = "**paused** · " if pace.paused else ""
        speed = f"{pace.frames:.0f} pictures/s, {pace.reached:.2g} × real time"
        return (
            f"**t = {axis.time:.{1 if pace.paused else 0}f} s** · {head}{self.session.said}  \n"
            f"<small>{speed}, {pace.load:.0f} % of a core · bands ±2σ as claimed · "
            "truth dashed</small>"
        )


def _clicked(act: Callable[[str], None]) -> Callable[[Any], Any]:
    """Return what viser is to call: it knows which button of a row it was before the next click."""

    async def clicked(event: Any) -> None:
        # In a thread, for an act may have to wait for the session, and no viewer for an act.
        asyncio.get_running_loop().run_in_executor(None, act, event.target.value)

    return clicked
