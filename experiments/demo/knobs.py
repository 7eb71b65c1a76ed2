"""Knobs of the page: those of the axis, of its friction, and of each estimator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log10
from typing import Any

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.demo.input_check import InputCheck
from flexaxis.experiments.demo.live_axis import EXCITATION, KINDS, LIMITS, UNITS
from flexaxis.experiments.demo.racer import NAMES, KnobSettings
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.experiments.running.estimators import parse

# One is slower than the axis, the other would have to be told when somebody clicks.
NOT_HERE = {"oracle-reset"}


@dataclass(frozen=True)
class Bench:
    """What knobs are put on, and what they act on.

    Attributes
    ----------
    gui : viser.GuiApi
    check : InputCheck
    session : DemoSession
    guarded : callable
        Wraps what acts on the session.
    """

    gui: Any
    check: InputCheck
    session: DemoSession
    guarded: Callable[[Callable[..., None]], Callable[..., None]]

    @staticmethod
    def on(control: Any, act: Callable[[], None]) -> None:
        """Let a control act when a viewer turns it, and not when it follows something itself."""
        control.on_update(lambda event: act() if event.client else None)


def add_axis_knobs(bench: Bench) -> None:
    """Add sliders for noise, and the choice of an excitation."""
    gui, axis, session = bench.gui, bench.session.axis, bench.session
    noise = bench.check.slider(gui, "noise [rad/s]", 0.0, 0.5, 0.01, axis.noise)
    bench.on(noise, lambda: bench.guarded(session.disturb)(float(noise.value)))
    moving = bench.check.choice(gui, "excitation", EXCITATION, initial=axis.excitation)
    bench.on(moving, lambda: bench.guarded(session.excite)(moving.value))


class FrictionKnobs:
    """Choice of a law of dry friction, and those of its sliders that mean something."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        gui, check, friction = bench.gui, bench.check, bench.session.axis.friction
        self._kind = check.choice(gui, "friction", KINDS, initial=friction.kind)
        self._sliders = {
            name: check.slider(
                gui, f"{name} [{UNITS[name]}]", low, high, 0.01, getattr(friction, name)
            )
            for name, (low, high) in LIMITS.items()
        }
        self._show()
        for control in (self._kind, *self._sliders.values()):
            bench.on(control, self._rub)

    def _rub(self) -> None:
        values = {name: float(slider.value) for name, slider in self._sliders.items()}
        session = self._bench.session
        self._bench.guarded(session.rub)(
            replace(session.axis.friction, kind=self._kind.value, **values)
        )
        self._show()

    def _show(self) -> None:
        knobs = self._bench.session.axis.friction.knobs
        for name, slider in self._sliders.items():
            slider.visible = name in knobs


class Knobs:
    """Choice of an estimator, and those of its knobs that it has.

    Parameters
    ----------
    bench : Bench
    number : int
        Which of the racers.
    """

    def __init__(self, bench: Bench, number: int) -> None:
        self._session, self._number, self._guarded = bench.session, number, bench.guarded
        gui, check = bench.gui, bench.check
        racer = bench.session.racers[number]
        offered = [name for name in REGISTRY if name not in NOT_HERE]
        # Built from what we offer ourselves: a choice is looked up here, and its text not read.
        self._specs = {racer.text: racer.spec} | {name: parse(name) for name in offered}
        self._choice = check.choice(gui, "estimator", list(self._specs), initial=racer.text)
        self._forgetting = check.slider(gui, "λ", 0.97, 0.9995, 0.0005, 0.995)
        self._drift = {
            name: check.slider(gui, f"log₁₀ Δ {name}", -9.0, -3.0, 0.1, -6.0) for name in NAMES
        }
        self._mu = check.slider(gui, "μ", 0.0, 1.0, 0.01, 0.0)
        self._none = gui.add_markdown("it tunes itself: nothing to turn")
        self._show()
        bench.on(self._choice, self._choose)
        for knob in (self._forgetting, *self._drift.values(), self._mu):
            bench.on(knob, self._turn)

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
        self._none.visible = not knobs
        self._forgetting.visible = "forgetting" in knobs
        self._mu.visible = "regularization" in knobs
        self._forgetting.value, self._mu.value = tuning.forgetting, tuning.regularization
        for name, slider in self._drift.items():
            slider.visible = "drift" in knobs
            slider.value = round(log10(tuning.drift[name]), 1)
