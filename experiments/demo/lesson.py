"""A lesson: what is done to the live axis when, as TOML, for a demo without hands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError, model_validator

from flexaxis.experiments.demo.live_axis import EXCITATION, FACTORS, KINDS, LIMITS
from flexaxis.experiments.demo.racer import NAMES, Racer
from flexaxis.experiments.demo.session import DEFAULT_RACERS, DemoSession
from flexaxis.experiments.running.user_code import names_code
from flexaxis.sim.conflicts import explain
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.files import read_text, toml_tables
from flexaxis.sim.parameters import PARAMETER_NAMES, preset
from flexaxis.sim.tables.config import Config, NotNegative, Positive
from flexaxis.sim.timing import PERIOD, sample_index


class LessonError(FlexaxisError):
    """A lesson cannot be read; one line for each problem."""


def _one_of(what: str, known: tuple[str, ...]) -> AfterValidator:
    """Return a check that a text, or each key of a table, is known."""

    def check(given: Any) -> Any:
        for name in [given] if isinstance(given, str) else given:
            if name not in known:
                raise ValueError(unknown(what, name, known))
        return given

    return AfterValidator(check)


def _can_race(text: str) -> str:
    if not names_code(text):  # code runs only with consent, which is asked for after reading
        try:
            Racer(text, preset("n1"))
        except (FlexaxisError, TypeError) as error:  # pydantic takes ValueError alone
            raise ValueError(str(error)) from error
    return text


BREAKABLE = tuple(name for name in PARAMETER_NAMES if name != "r")
FrictionValue = {name: Field(ge=low, le=high) for name, (low, high) in LIMITS.items()}
Raceable = Annotated[str, AfterValidator(_can_race)]


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
    friction : {"none", "Coulomb", "static curve", "LuGre"}
        Law of dry friction from then on.
    f_c, f_s, v_s : float
        Its level, its excess at low speed [N m], and where that ends [rad/s]; those not named stay.
    excitation : {"on", "stop-and-go", "off"}
        Whether the axis moves.
    noise : float
        Standard deviation of the measured speed [rad/s].
    racer : {"A", "B"}
        Whose knobs are turned; both where it is not said.
    estimator : str
        Who takes the place of that racer.
    forgetting, regularization : float
        λ and μ.
    drift : dict of str to float
        Diagonal of Δ, by parameter; those not named stay.
    """

    at: NotNegative
    say: str | None = None
    fault: Annotated[str, _one_of("parameter", BREAKABLE)] | None = None
    factor: Annotated[float, Field(ge=FACTORS[0], le=FACTORS[1])] | None = None
    repair: bool = False
    friction: Annotated[str, _one_of("friction", KINDS)] | None = None
    f_c: Annotated[float, FrictionValue["f_c"]] | None = None
    f_s: Annotated[float, FrictionValue["f_s"]] | None = None
    v_s: Annotated[float, FrictionValue["v_s"]] | None = None
    excitation: Annotated[str, _one_of("excitation", EXCITATION)] | None = None
    noise: NotNegative | None = None
    racer: Literal["A", "B"] | None = None
    estimator: Raceable | None = None
    forgetting: Annotated[float, Field(gt=0, le=1)] | None = None
    regularization: NotNegative | None = None
    drift: Annotated[dict[str, Positive], _one_of("parameter", NAMES)] | None = None

    @model_validator(mode="after")
    def _goes_together(self) -> Act:
        if (self.fault is None) != (self.factor is None):
            raise ValueError("fault and factor go together, as in fault = 'f_m', factor = 2.0")
        if self.estimator is not None and self.racer is None:
            raise ValueError("estimator needs racer = 'A' or 'B': in whose place?")
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
        self._rub(session)
        if self.excitation is not None:
            session.excite(self.excitation)
        if self.noise is not None:
            session.disturb(self.noise)
        if self.estimator is not None and self.racer is not None:
            session.choose("AB".index(self.racer), self.estimator)
        self._turn(session)

    def _given(self, *names: str) -> dict[str, Any]:
        return self.model_dump(include={*names}, exclude_none=True)

    def _rub(self, session: DemoSession) -> None:
        now = session.axis.friction
        session.rub(replace(now, kind=self.friction or now.kind, **self._given(*LIMITS)))

    def _turn(self, session: DemoSession) -> None:
        turned = self._given("forgetting", "regularization")
        if not turned and not self.drift:
            return
        for number in (0, 1) if self.racer is None else ("AB".index(self.racer),):
            tuning = session.racers[number].tuning
            session.tune(
                number, replace(tuning, **turned, drift={**tuning.drift, **(self.drift or {})})
            )


class Lesson(Config):
    """A lesson: how long, how fast, and what happens in it.

    Attributes
    ----------
    title : str
        Shown on top.
    seed : int
        Of excitation and noise.
    start : float
        Seconds of the axis that pass unseen before it is shown.
    duration : float
        Seconds of the axis that are shown.
    speed : float
        Seconds of the axis in one of the demo.
    frames : int
        Pictures a second of a recording.
    estimators : tuple of str
        The two that race.
    act : tuple of Act
        What happens, in any order; times are those of the axis, from its first sample.
    """

    title: str = "flexaxis"
    seed: Annotated[int, Field(ge=0)] = 0
    start: Annotated[float, Field(ge=0, le=36000)] = 0.0
    duration: Annotated[float, Field(gt=0, le=7200)] = 40.0
    speed: Annotated[float, Field(gt=0, le=20)] = 2.0
    frames: Annotated[int, Field(ge=1, le=60)] = 8
    estimators: Annotated[tuple[Raceable, Raceable], Field(strict=False)] = DEFAULT_RACERS
    act: Annotated[tuple[Act, ...], Field(strict=False)] = ()

    @property
    def named(self) -> tuple[str, ...]:
        """All estimators that it names."""
        return (*self.estimators, *(act.estimator for act in self.act if act.estimator))


class Player:
    """A lesson as it is played on a session, sample by sample.

    Parameters
    ----------
    session : DemoSession
        Its samples before `lesson.start` are simulated here.
    lesson : Lesson
    failed : callable, optional
        Gets a line on an act that cannot be done, and the lesson goes on; else it is raised.

    Attributes
    ----------
    caption : str
        What the lesson says now.
    """

    def __init__(
        self,
        session: DemoSession,
        lesson: Lesson,
        failed: Callable[[str], None] | None = None,
    ) -> None:
        self._session, self.caption, self._failed = session, "", failed
        self._acts = deque(sorted(enumerate(lesson.act), key=lambda numbered: numbered[1].at))
        self.advance(sample_index(lesson.start, PERIOD))

    def advance(self, samples: int) -> None:
        """Simulate some samples, and do on the way what is to be done."""
        until = self._session.axis.samples + samples
        while self._acts and sample_index(self._acts[0][1].at, PERIOD) < until:
            number, act = self._acts.popleft()
            begin = sample_index(act.at, PERIOD)
            self._session.advance(max(0, begin - self._session.axis.samples))
            self._do(number, act)
        self._session.advance(until - self._session.axis.samples)

    def _do(self, number: int, act: Act) -> None:
        if act.say is not None:
            self.caption = act.say
        try:
            act.do(self._session)
        except Exception as error:  # whatever it is, such as of a stranger's estimator
            problem = f"act[{number}] at {act.at:g} s cannot be done: {error}"
            if self._failed is None:
                raise LessonError(problem) from error
            self._session.said = problem
            self._failed(problem)
            return
        if act.say is not None:
            self._session.said = act.say


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
    try:
        return Lesson.model_validate(content)
    except ValidationError as error:
        problems = (f"{source}: {key}: {words}" for key, words in explain(error, Lesson))
        raise LessonError("\n".join(problems)) from None
