"""A lesson: what is done to the live axis when, as TOML, for a recording without hands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from flexaxis.experiments.demo.live_axis import EXCITATION
from flexaxis.experiments.demo.session import DEFAULT_RACERS, DemoSession
from flexaxis.sim.config import Config, NotNegative
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.problems import explain
from flexaxis.sim.reading import read_text, toml_tables


class LessonError(FlexaxisError):
    """A lesson cannot be read; one line for each problem."""


class Act(Config):
    """What happens at one time; the tables ``[[act]]`` of a lesson.

    Attributes
    ----------
    at : float
        When [s of the axis].
    say : str
        Caption from then on.
    fault, factor : str, float
        Parameter, and its value over nominal from then on.
    repair : bool
        Whether all faults are repaired.
    excitation : {"on", "stop-and-go", "off"}
        Whether the axis moves.
    noise : float
        Standard deviation of the measured speed [rad/s].
    racer : {"A", "B"}
        Whose knobs are turned; both where it is not said.
    forgetting, regularization : float
        λ and μ.
    drift : dict of str to float
        Diagonal of Δ, by parameter; those not named stay.
    """

    at: NotNegative
    say: str | None = None
    fault: str | None = None
    factor: float | None = None
    repair: bool = False
    excitation: str | None = None
    noise: NotNegative | None = None
    racer: Literal["A", "B"] | None = None
    forgetting: float | None = None
    regularization: NotNegative | None = None
    drift: dict[str, float] | None = None

    @model_validator(mode="after")
    def _goes_together(self) -> Act:
        if (self.fault is None) != (self.factor is None):
            raise ValueError("fault and factor go together, as in fault = 'f_m', factor = 2.0")
        if self.excitation is not None and self.excitation not in EXCITATION:
            raise ValueError(unknown("excitation", self.excitation, EXCITATION))
        return self

    def do(self, session: DemoSession) -> None:
        """Do it to a session.

        Raises
        ------
        FlexaxisError, EstimatorError
            If a value is refused.
        """
        if self.repair:
            session.repair()
        if self.fault is not None and self.factor is not None:
            session.inject(self.fault, self.factor)
        if self.excitation is not None:
            session.axis.excitation = self.excitation
        if self.noise is not None:
            session.axis.noise = self.noise
        knobs = {
            "forgetting": self.forgetting,
            "regularization": self.regularization,
        }
        turned: dict[str, Any] = {key: value for key, value in knobs.items() if value is not None}
        for number in (0, 1) if self.racer is None else ("AB".index(self.racer),):
            tuning = session.racers[number].tuning
            session.tune(
                number, replace(tuning, **turned, drift={**tuning.drift, **(self.drift or {})})
            )


class Lesson(Config):
    """A recording: how long, how fast, and what happens in it.

    Attributes
    ----------
    title : str
        Shown on top.
    duration : float
        Seconds of the axis.
    speed : float
        Seconds of the axis in one of the recording.
    frames : int
        Pictures a second of the recording.
    estimators : tuple of str
        The two that race.
    act : tuple of Act
        What happens, in any order.
    """

    title: str = "flexaxis"
    duration: Annotated[float, Field(gt=0, le=600)] = 40.0
    speed: Annotated[float, Field(gt=0, le=20)] = 2.0
    frames: Annotated[int, Field(ge=1, le=60)] = 8
    estimators: Annotated[tuple[str, str], Field(strict=False)] = DEFAULT_RACERS
    act: tuple[Act, ...] = ()


def default_lesson() -> str:
    """Return the text of the lesson that is recorded if none is named."""
    return (resources.files(__package__) / "lessons" / "faults.toml").read_text(encoding="utf-8")


def load_lesson(path: Path | None) -> Lesson:
    """Return the lesson in a file, or the default one.

    Raises
    ------
    LessonError
        With a line for each problem.
    """
    text = default_lesson() if path is None else read_text(path, LessonError)
    return parse_lesson(text, source=str(path or "default lesson"))


def parse_lesson(text: str, *, source: str) -> Lesson:
    """Return a lesson from TOML text; errors as from `load_lesson`."""
    content = toml_tables(text, source=source, refuse=LessonError)
    given = content.pop("act", [])
    acts = given if isinstance(given, list) else [given]
    problems = [f"{key}: {text}" for key, text in _problems(content, Lesson)]
    for number, act in enumerate(acts):
        problems += [
            f"act[{number}] {key}: {text}".replace(" : ", ": ") for key, text in _problems(act, Act)
        ]
    if problems:
        raise LessonError("\n".join(f"{source}: {problem}" for problem in problems))
    return Lesson.model_validate(content | {"act": tuple(Act.model_validate(act) for act in acts)})


def _problems(content: Mapping[str, Any], table: type[Config]) -> list[tuple[str, str]]:
    try:
        table.model_validate(content)
    except ValidationError as error:
        whole = [e["msg"].removeprefix("Value error, ") for e in error.errors() if not e["loc"]]
        return [*explain(error, table), *(("", text) for text in whole)]
    return []
