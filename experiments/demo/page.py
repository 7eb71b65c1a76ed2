"""The page: the axis in 3-D, buttons, knobs, curves and history, for any number of viewers."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any
from weakref import WeakKeyDictionary

from flexaxis.experiments.demo import curves
from flexaxis.experiments.demo.curves import estimates_table, history_table
from flexaxis.experiments.demo.door import DemoServer
from flexaxis.experiments.demo.knobs import Bench, FrictionKnobs, Knobs, add_axis_knobs
from flexaxis.experiments.demo.session import BUTTONS, MARK, DemoSession
from flexaxis.experiments.demo.view import exaggerated, scene
from flexaxis.experiments.reporting import styles
from flexaxis.experiments.reporting.charts_old import marks
from flexaxis.experiments.reporting.charts_old.charts import Chart
from flexaxis.experiments.reporting.charts_old.drawing import drawn
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.timing import PERIOD

BREAK, CLOCK = "break it", "clock"
REPAIR = "Repair everything"
RUN, PAUSE, STEP = "Run", "Pause", f"Step {MARK * PERIOD:g} s"
SAVE = "save"
NEXT_SAVE = 1.0  # s until a viewer gets another file: those that nobody reads wait in memory
SAVE_CSV, SAVE_LESSON = "Table (CSV)", "Lesson (TOML)"
WIDTH, CURVES_WIDTH = 440, 390  # pixels, of 1400
HIGH, LEFT_HIGH = 86, 170  # pixels of a panel of the curves, and of what is left to be found


@dataclass
class Pace:
    """How fast the demo runs: what was asked for, and what was reached; what that costs."""

    speed: float = 1.0
    frames: float = 0.0
    reached: float = 0.0
    load: float = 0.0
    paused: bool = False
    steps: int = 0
    _counted: tuple[int, int] = 0, 0
    _since: tuple[float, float] = 0.0, 0.0

    def count(self, due: int) -> None:
        """Count a picture and its samples; put what was reached down every other second."""
        now = time.monotonic(), time.process_time()
        elapsed, work = now[0] - self._since[0], now[1] - self._since[1]
        frames, samples = self._counted[0] + (due > 0), self._counted[1] + due
        self._counted = frames, samples
        if elapsed >= 2.0:
            self.frames, self.reached = frames / elapsed, samples * PERIOD / elapsed
            self.load, self._counted, self._since = 100 * work / elapsed, (0, 0), now


class Page:
    """Everything on the page, and the lock between the viewers' clicks and the session.

    Parameters
    ----------
    server : DemoServer
        What is put on the page is told to its check.
    session : DemoSession
    exaggerate, speed : float
        As for `serve`.
    """

    def __init__(
        self,
        server: DemoServer,
        session: DemoSession,
        *,
        exaggerate: float,
        speed: float,
    ) -> None:
        self.server, self.session, self.pace = server.viser, session, Pace(speed)
        self._check, self._exaggerate = server.check, exaggerate
        self._advance: Callable[[int], None] = session.advance
        self._drawn = -1
        self._saved: WeakKeyDictionary[Any, float] = WeakKeyDictionary()
        self._lock = threading.Lock()
        self._build_scene()
        self._build_controls()
        self._build_curves()
        server.check.refused = lambda line: setattr(session, "said", line)

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
        with self._lock:
            shown = self._contents()
        for place, content in shown:
            if place.content != content:
                place.content = content

    def _contents(self) -> list[tuple[Any, str]]:
        """Return what stands in each place of the page that changes."""
        session = self.session
        last = session.history.last
        found = [
            (self._said, self._status()),
            (self._table, estimates_table(session)),
            (self._past, history_table(session.history)),
            (self._left, _drawn(curves.left(last), LEFT_HIGH)),
        ]
        if self._drawn != session.axis.samples:
            self._drawn = session.axis.samples
            points = curves.tradeoff(session.points, last.allowed if last else (None, None))
            own = [
                _drawn(show(racer), HIGH)
                for racer in session.racers
                if (show := curves.OWN.get(racer.name))
            ]
            found += [
                (self._curves, _drawn(curves.estimates(session.curves()), HIGH)),
                (self._points, _drawn(points, LEFT_HIGH)),
                (self._own, "".join(own)),
            ]
        return found

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
        gui, check, session = self.server.gui, self._check, self.session
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        gui.set_panel_label("flexaxis: break it, and watch who sees it first")
        gui.add_html(_style())
        broken = check.group(gui, BREAK, [*BUTTONS, REPAIR])
        broken.on_click(_clicked(self._break))
        clock = check.group(gui, CLOCK, [RUN, PAUSE, STEP])
        clock.on_click(_clicked(self._wind))
        self._rows = broken, clock
        self._said = gui.add_markdown("")
        self._left, self._table = gui.add_html(""), gui.add_html("")
        bench = Bench(gui, check, session, self._guarded)
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
        gui, check = self.server.gui, self._check
        panel = gui.add_panel()
        with panel.add_tab("Estimates"):
            self._curves, self._points, self._own = (gui.add_html("") for _ in range(3))
        with panel.add_tab("What was done"):
            saved = check.group(gui, SAVE, [SAVE_CSV, SAVE_LESSON])
            saved.on_click(self._save)
            self._past = gui.add_html("")
        panel.dock_left()
        panel.set_width(CURVES_WIDTH)

    def _add_speed(self) -> None:
        wanted = self.pace.speed
        slowest, fastest = min(0.25, wanted), max(10.0, wanted)
        pace = self._check.slider(self.server.gui, "speed ×", slowest, fastest, 0.05, wanted)
        pace.on_update(lambda _: setattr(self.pace, "speed", float(pace.value)))

    def _break(self, label: str) -> None:
        if label == REPAIR:
            self._guarded(self.session.repair)()
        else:
            self._guarded(self.session.inject)(*BUTTONS[label])

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


def _style() -> str:
    """Return the style of the page, and what its curves have of the pages."""
    sheets = (
        files("flexaxis.experiments.reporting.charts_old") / "templates" / "charts.css",
        files("flexaxis.experiments.demo") / "page.css",
    )
    colours = "".join(f"--style-{each.place}: {each.light}; " for each in styles.NINE)
    colours += f"--theory: {curves.GREY};"
    text = "".join(sheet.read_text(encoding="utf-8") for sheet in sheets)
    who = dict(curves.STYLES)
    return (
        f"<style>{text}:root {{ {colours} }}{marks.rules(who)}</style>"
        f'<svg id="marks" width="0" height="0"><defs>{marks.marks(who)}</defs></svg>'
    )


def _drawn(chart: Chart, high: int) -> str:
    return f'<h4 class="chart">{escape(chart.title)}</h4>{drawn(chart, "", high=high)}'


def _clicked(act: Callable[[str], None]) -> Callable[[Any], Any]:
    """Return what viser is to call: it knows which button of a row it was before the next click."""

    async def clicked(event: Any) -> None:
        # In a thread, for an act may have to wait for the session, and no viewer for an act.
        asyncio.get_running_loop().run_in_executor(None, act, event.target.value)

    return clicked
