"""Read a study from a TOML file: scenarios, estimators, seeds and swept values."""

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
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.config import Config, Word
from flexaxis.sim.text_files import read_toml

FIRST = 1000
"""First random seed for reported results; seeds 0 to 99 are reserved for tuning."""
MOST = 100_000  # largest number of seeds


def seed_of(seed: Any) -> int:
    """Return the seed if it is an integer from 0 to 2^63 − 1; otherwise raise an error."""
    if not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise FlexaxisError(f"seed {seed!s:.40}: a seed must be an integer from 0 to 2^63 - 1")
    return int(seed)


def seeds_of(seeds: Any, default: int = 8) -> tuple[int, ...]:
    """Return the seeds that are given as a number, a range or a list.

    A number N means the seeds 1000 to 1000 + N - 1. A range "A:B" means the seeds A to B - 1.

    Raises
    ------
    FlexaxisError
        If the seeds are not given as a number, a range or a list, or if there are too many seeds.

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
            f"seeds {text!r}: give a number of seeds, such as 8, or a range, such as 1000:1030 "
            f"(which excludes 1030). At most {MOST} seeds are allowed"
        )
    return tuple(result)


def texts_of(estimators: Any) -> tuple[str, ...]:
    """Return the specifications of all given estimators; a class is specified by its name."""
    one = isinstance(estimators, str) or callable(estimators)
    return tuple(dict.fromkeys(map(specs.text_of, [estimators] if one else estimators)))


def _one_or_more(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _flat(value: Any) -> Any:
    """Convert nested tables to dotted keys; TOML reads an unquoted a.b as a nested table."""
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
    """Check the specification of an estimator without importing any user code."""
    specs.written_options(text) if names_code(text) else specs.parse(text)
    return text


def _scenario(name: str, info: ValidationInfo) -> Scenario:
    beside = info.context / name  # type: ignore[operator]
    return find_scenario(str(beside if beside.is_file() else name))


Dotted = Annotated[dict[str, Any], BeforeValidator(_flat)]
Axes = Annotated[dict[str, Annotated[list[Any], Field(min_length=1)]], BeforeValidator(_flat)]


class StudyFile(Config):
    """The keys of a study file; the page docs/studies.md explains these keys."""

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
"""Placeholders for missing or invalid values, with which the other keys can be checked."""


def load_study(path: str | Path) -> Study:
    """Read a study from a TOML file.

    The paths of scenario files are relative to the folder of the study file.

    Raises
    ------
    StudyError
        If the study file is invalid. The error message contains one line for each problem, with the
        file and the key.
    """
    path = Path(path)
    content = {"name": path.stem} | read_toml(path, StudyError)
    return study_from(content, source=str(path), folder=path.parent)


def study_from(
    content: Mapping[str, Any], *, source: str = "study", folder: Path = Path()
) -> Study:
    """Create a study from keys and values, such as the content of a study file.

    Parameters
    ----------
    content : mapping
        Keys and values of the study.
    source : str
        Name of the study in error messages.
    folder : Path
        Folder in which the function searches for scenario files before it searches the current
        folder.

    Raises
    ------
    StudyError
        If a key or value is invalid. The error message contains one line for each problem.
    """
    problems: list[tuple[object, str]] = []
    try:
        file = StudyFile.model_validate(dict(content), context=folder)
    except ValidationError as error:
        # Missing keys come last, because an unknown key is often a missing key that is misspelt.
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
            problems.append((f"sweep.{key}", f"no scenario and no estimator has this key.{hint}"))
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
