"""The page: the axis in 3-D, buttons, knobs and curves, for any number of viewers at once."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from math import log10
from typing import Any

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.specs import parse
from flexaxis.experiments.demo.charts import COLOURS, Charts
from flexaxis.experiments.demo.live_axis import EXCITATION
from flexaxis.experiments.demo.offers import Offers
from flexaxis.experiments.demo.racer import NAMES, KnobSettings
from flexaxis.experiments.demo.session import BUTTONS, DemoSession
from flexaxis.experiments.reporting.view import exaggerated, scene

REPAIR = "Repair everything"
# One is slower than the axis, the other would have to be told when somebody clicks.
NOT_HERE = {"literal-rpem", "oracle-reset"}


@dataclass
class Pace:
    """How fast the demo runs: what was asked for, and what was reached."""

    speed: float = 1.0
    frames: float = 0.0
    reached: float = 0.0
    load: float = 0.0


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
        self._offers = offers
        self._exaggerate = exaggerate
        self._lock = threading.Lock()
        self._build_scene()
        gui = server.gui
        gui.configure_theme(
            control_layout="fixed", control_width="large", show_logo=False, show_share_button=False
        )
        gui.set_panel_label("flexaxis: break it, and watch who sees it first")
        for button in BUTTONS:
            inject = self._guarded(session.inject)
            offers.button(gui, button.label).on_click(
                lambda _, b=button, f=inject: f(b.parameter, b.factor)
            )
        repair = self._guarded(session.repair)
        offers.button(gui, REPAIR, color="gray").on_click(lambda _: repair())
        self._numbers = gui.add_markdown("")
        self._build_knobs()
        self._charts = Charts(gui, session.axis.theta(NAMES))
        offers.refused = lambda line: setattr(session, "said", line)

    @property
    def watched(self) -> bool:
        """Whether anybody looks."""
        return bool(self.server.get_clients())

    def advance(self, samples: int) -> None:
        """Let the session go on."""
        with self._lock:
            self.session.advance(samples)

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
            curves, dots = self.session.curves(), list(self.session.dots)
            text = self._table()
        self._numbers.content = text
        self._charts.update(curves, dots)

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

    def _build_knobs(self) -> None:
        gui, axis, offers = self.server.gui, self.session.axis, self._offers
        with gui.add_folder("Axis: speed, noise, excitation", expand_by_default=False):
            wanted = self.pace.speed
            slowest, fastest = min(0.25, wanted), max(10.0, wanted)
            pace = offers.slider(gui, "speed ×", slowest, fastest, 0.05, wanted)
            pace.on_update(lambda _: setattr(self.pace, "speed", float(pace.value)))
            noise = offers.slider(gui, "noise [rad/s]", 0.0, 0.5, 0.01, axis.noise)
            noise.on_update(lambda _: setattr(axis, "noise", float(noise.value)))
            moving = offers.choice(gui, "excitation", EXCITATION, initial=axis.excitation)
            moving.on_update(lambda _: self._guarded(setattr)(axis, "excitation", moving.value))
        for number in range(len(self.session.racers)):
            with gui.add_folder(
                f"Estimator {'AB'[number]}: which, λ, Δ, μ", expand_by_default=False
            ):
                Knobs(gui, self.session, number, self._guarded, offers)

    def _guarded(self, act: Callable[..., None]) -> Callable[..., None]:
        """Let a click act on the session alone, and tell what was wrong instead of failing."""

        def guarded(*args: Any) -> None:
            with self._lock:
                try:
                    act(*args)
                except ValueError as error:
                    self.session.said = str(error)

        return guarded

    def _table(self) -> str:
        axis, pace = self.session.axis, self.pace
        lines = [
            f"**t = {axis.time:.0f} s** · {self.session.said}",
            "",
            "| | truth | "
            + " | ".join(
                f'<span style="color:{colour}">{letter}: {racer.text}</span>'
                for colour, letter, racer in zip(COLOURS, "AB", self.session.racers, strict=True)
            )
            + " |",
            "|---|---|---|---|",
        ]
        truth = axis.theta(NAMES)
        for i, name in enumerate(NAMES):
            cells = [truth[i], *(racer.theta[i] for racer in self.session.racers)]
            lines.append(f"| {name} | " + " | ".join(f"{cell:.4g}" for cell in cells) + " |")
        lines += [
            "",
            f"{pace.frames:.0f} frames/s · {pace.reached:.2g} × real time · "
            f"server {pace.load:.0f} % of a core · band ±2σ as claimed · truth dashed",
        ]
        return "\n".join(lines)


class Knobs:
    """Choice of an estimator, and those of its knobs that it has.

    Parameters
    ----------
    gui : viser.GuiApi
    session : DemoSession
    number : int
        Which of the racers.
    guarded : callable
        Wraps what acts on the session.
    offers : Offers
    """

    def __init__(
        self,
        gui: Any,
        session: DemoSession,
        number: int,
        guarded: Callable[..., Any],
        offers: Offers,
    ) -> None:
        self._session, self._number, self._guarded = session, number, guarded
        racer = session.racers[number]
        offered = [name for name in REGISTRY if name not in NOT_HERE]
        # Built from what we offer ourselves: a choice is looked up here, and its text not read.
        self._specs = {racer.text: racer.spec} | {name: parse(name) for name in offered}
        self._choice = offers.choice(gui, "estimator", list(self._specs), initial=racer.text)
        self._forgetting = offers.slider(gui, "λ", 0.97, 0.9995, 0.0005, 0.995)
        self._drift = {
            name: offers.slider(gui, f"log₁₀ Δ {name}", -9.0, -3.0, 0.1, -6.0) for name in NAMES
        }
        self._mu = offers.slider(gui, "μ", 0.0, 1.0, 0.01, 0.0)
        self._show()
        # A slider that is put where its knob stands has no client, and turns nothing.
        self._choice.on_update(lambda event: self._choose() if event.client else None)
        for knob in (self._forgetting, *self._drift.values(), self._mu):
            knob.on_update(lambda event: self._turn() if event.client else None)

    def _choose(self) -> None:
        self._guarded(self._session.choose)(self._number, self._specs[self._choice.value])
        self._show()

    def _turn(self) -> None:
        self._guarded(self._session.tune)(self._number, self._wanted())

    def _wanted(self) -> KnobSettings:
        return KnobSettings(
            forgetting=float(self._forgetting.value),
            drift={name: 10.0 ** float(knob.value) for name, knob in self._drift.items()},
            regularization=float(self._mu.value),
        )

    def _show(self) -> None:
        """Put the sliders where the knobs stand, and hide those that the estimator lacks."""
        racer = self._session.racers[self._number]
        tuning, knobs = racer.tuning, racer.knobs
        self._forgetting.visible = "forgetting" in knobs
        self._mu.visible = "regularization" in knobs
        self._forgetting.value, self._mu.value = tuning.forgetting, tuning.regularization
        for name, slider in self._drift.items():
            slider.visible = "drift" in knobs
            slider.value = round(log10(tuning.drift[name]), 1)
