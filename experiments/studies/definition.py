"""A study as a TOML file: scenarios, estimators, seeds, and the grid of values that is swept."""

import re
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, ValidationInfo

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running import estimators as specs
from flexaxis.experiments.running.study import ALL, Study, is_option, units
from flexaxis.experiments.running.user_code import names_code
from flexaxis.sim.conflicts import explain
from flexaxis.sim.errors import FlexaxisError, ScenarioError, did_you_mean
from flexaxis.sim.files import read_toml
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.config import Config, Word

FIRST = 1000
"""The first seed that is reported on; 0 to 99 are for tuning."""
MOST = 100_000  # seeds


def seed_of(seed: Any) -> int:
    """Return a seed; raise an error unless it is a whole number from 0 to 2^63 − 1."""
    if not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise FlexaxisError(f"seed {seed!s:.40}: give a whole number from 0 to 2^63 - 1")
    return int(seed)


def seeds_of(seeds: Any, default: int = 8) -> tuple[int, ...]:
    """Return seeds: a number N of them (1000 … 1000+N−1), a range "A:B" (A … B−1), or those listed.

    Raises
    ------
    FlexaxisError
        If it is nothing of these, or has too many seeds.

    Examples
    --------
    >>> seeds_of(2), seeds_of("5:7"), seeds_of(range(3))
    ((1000, 1001), (5, 6), (0, 1, 2))
    """
    if not (seeds is None or isinstance(seeds, str | int | float)):
        return tuple(dict.fromkeys(map(seed_of, seeds)))
    text = str(default if seeds is None else seeds)
    first, colon, last = text.partition(":")
    try:
        result = range(int(first), int(last)) if colon else range(FIRST, FIRST + int(text))
    except ValueError:
        result = range(0)
    if not result or result[0] < 0 or len(result) > MOST:
        raise FlexaxisError(
            f"seeds {text!r}: give a number of seeds, such as 8, or a range from:to, such as "
            f"1000:1030 (the last is not included), at most {MOST}"
        )
    return tuple(result)


def texts_of(estimators: Any) -> tuple[str, ...]:
    """Return one estimator, or several, as text; classes have the text of their names."""
    one = isinstance(estimators, str) or callable(estimators)
    return tuple(dict.fromkeys(map(specs.text_of, [estimators] if one else estimators)))


def _one_or_more(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _flat(value: Any) -> Any:
    """Return nested tables as dotted keys: a key may be written with or without quotes."""
    if not isinstance(value, Mapping):
        return value
    result: dict[str, Any] = {}
    for key, inner in value.items():
        if isinstance(inner, Mapping):
            result |= {f"{key}.{k}": v for k, v in _flat(inner).items()}
        else:
            result[key] = inner
    return result


def _estimator(text: str) -> str:
    """Check a text; code of users is not imported before it is run."""
    specs.written_options(text) if names_code(text) else specs.parse(text)
    return text


def _scenario(name: str, info: ValidationInfo) -> Scenario:
    beside = info.context / name  # type: ignore[operator]
    return find_scenario(str(beside if beside.is_file() else name))


Dotted = Annotated[dict[str, Any], BeforeValidator(_flat)]
Axes = Annotated[dict[str, Annotated[list[Any], Field(min_length=1)]], BeforeValidator(_flat)]


class StudyFile(Config):
    """The keys of a study file; docs/studies.md explains each."""

    name: Word = "study"
    scenario: Annotated[
        tuple[Annotated[Any, AfterValidator(_scenario)], ...],
        BeforeValidator(_one_or_more),
        Field(strict=False),
    ]
    estimators: Annotated[
        tuple[Annotated[str, AfterValidator(_estimator)], ...], BeforeValidator(texts_of)
    ]
    seeds: Annotated[tuple[int, ...], BeforeValidator(seeds_of)]
    override: Dotted = Field(default_factory=dict)
    sweep: Axes = Field(default_factory=dict)
    streams: Literal["common", "own"] = "common"


BLANK = {"scenario": (), "estimators": (), "seeds": 1}
"""What stands for a missing or wrong key while the others are checked."""


def load_study(path: str | Path) -> Study:
    """Return the study in a TOML file; paths of scenario files are relative to its folder.

    Raises
    ------
    StudyError
        With one line for each problem, naming file and key.
    """
    path = Path(path)
    content = {"name": path.stem} | read_toml(path, StudyError)
    return study_from(content, source=str(path), folder=path.parent)


def study_from(
    content: Mapping[str, Any], *, source: str = "study", folder: Path = Path()
) -> Study:
    """Return a study from keys and values, as from a TOML file.

    Parameters
    ----------
    content : mapping
    source : str
        What to call it in messages.
    folder : Path
        Where scenario files are looked for before the current folder.

    Raises
    ------
    StudyError
        With one line for each problem.
    """
    problems: list[tuple[object, str]] = []
    try:
        file = StudyFile.model_validate(dict(content), context=folder)
    except ValidationError as error:
        # An unknown key comes first: it is mostly a missing one, misspelt.
        problems += sorted(explain(error, StudyFile), key=lambda each: each[1] == "is missing")
        wrong = {item["loc"][0] for item in error.errors()}
        right = {key: value for key, value in content.items() if key not in wrong}
        file = StudyFile.model_validate(BLANK | right, context=folder)
    axes = {}
    for key, values in file.sweep.items():
        first = re.split(r"[.\[]", key)[0]
        if first in Scenario.model_fields or is_option(key, file.estimators):
            axes[key] = values
        elif file.estimators:
            hint = did_you_mean(first, [*file.estimators, ALL, *Scenario.model_fields])
            problems.append((f"sweep.{key}", f"neither of a scenario nor of an estimator.{hint}"))
    points = tuple(dict(zip(axes, values, strict=True)) for values in product(*axes.values()))
    try:
        scenarios = tuple(each.override(file.override) for each in file.scenario)
        study = Study(file.name, scenarios, file.estimators, file.seeds, tuple(axes), points,
                      file.streams)  # fmt: skip
        units(study)
    except (StudyError, ScenarioError) as error:
        problems.append(("sweep" if axes else "override", str(error).split("sweep: ")[-1]))
    if problems:
        lines = [f"{source}: {key}: {t}" for key, text in problems for t in text.splitlines()]
        raise StudyError("\n".join(dict.fromkeys(lines)))
    return study
