"""A lesson: what is done to the live axis and when, as TOML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, NonNegativeFloat, ValidationError

from flexaxis.experiments.demo.session import DEFAULT_RACERS, DemoSession
from flexaxis.sim.conflicts import explain
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.files import read_text, toml_tables
from flexaxis.sim.timing import PERIOD, sample_index

Letter = Literal["A", "B"]


class Act(BaseModel, extra="forbid"):
    """What is done at one time: a method of `DemoSession` with its arguments."""

    at: NonNegativeFloat
    say: str | None = None
    inject: tuple[str, float] | None = None
    repair: tuple[()] | None = None
    set_friction: tuple[str] | None = None
    set_excitation: tuple[str] | None = None
    set_noise: tuple[NonNegativeFloat] | None = None
    tune: tuple[Letter, str, float] | None = None
    choose: tuple[Letter, str] | None = None


class Lesson(BaseModel, extra="forbid"):
    """A lesson: two estimators, a seed, and acts."""

    estimators: tuple[str, str] = DEFAULT_RACERS
    seed: int = 0
    act: tuple[Act, ...] = ()


def load_lesson(path: Path) -> Lesson:
    """Return the lesson in a file; FlexaxisError with a line for each problem."""
    content = toml_tables(read_text(path, FlexaxisError), source=str(path), refuse=FlexaxisError)
    try:
        return Lesson.model_validate(content)
    except ValidationError as error:
        lines = (f"{path}: {key}: {words}" for key, words in explain(error, Lesson))
        raise FlexaxisError("\n".join(lines)) from None


def advance(session: DemoSession, acts: Sequence[Act], samples: int) -> None:
    """Simulate some samples, and do on the way those acts whose time has come."""
    end = session.axis.samples + samples
    for act in sorted(acts, key=lambda act: act.at):
        begin = sample_index(act.at, PERIOD)
        if session.axis.samples <= begin < end:
            session.advance(begin - session.axis.samples)
            done = act.model_dump(exclude={"at", "say"}, exclude_none=True)
            for action, values in done.items():
                session.do(action, *values)
            session.message = act.say or session.message
    session.advance(end - session.axis.samples)
