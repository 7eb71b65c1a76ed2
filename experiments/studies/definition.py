"""A study as a TOML file: scenarios, estimators, seeds, and the axes that are swept."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationError

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running import estimators as specs
from flexaxis.experiments.running.study import ALL, SIZE, Point, Study, is_option
from flexaxis.experiments.running.user_code import names_code
from flexaxis.experiments.seeds import END, parse_seeds
from flexaxis.experiments.studies.design import MOST, Span, listed, product, sample
from flexaxis.sim.conflicts import explain
from flexaxis.sim.errors import FlexaxisError, ScenarioError, did_you_mean
from flexaxis.sim.files import read_toml
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.config import Config, Word

Problem = tuple[str, str]
DRAWN = ("sobol", "latin")
"""Designs whose points are drawn."""


def _one_or_more(given: Any) -> Any:
    return (given,) if isinstance(given, str) else given


def _numbers(given: Any) -> Any:
    if isinstance(given, bool) or not isinstance(given, int | str):
        raise ValueError('must be a number of seeds, such as 60, or a range, such as "1000:1060"')
    try:
        return tuple(parse_seeds(str(given)))
    except FlexaxisError as error:
        raise ValueError(str(error).partition(": ")[2]) from None


def _flat(given: Any) -> Any:
    """Return nested tables as dotted keys: a key may be written with or without quotes."""
    if not isinstance(given, Mapping):
        return given
    found: dict[str, Any] = {}
    for key, value in given.items():
        if isinstance(value, Mapping):
            found |= {f"{key}.{inner}": leaf for inner, leaf in _flat(value).items()}
        else:
            found[key] = value
    return found


def _axes(given: Any) -> Any:
    """Return nested tables as dotted keys, down to arrays of values and tables of low and high."""
    if not isinstance(given, Mapping):
        return given
    found: dict[str, Any] = {}
    for key, value in given.items():
        plain = isinstance(value, Mapping) and any(
            isinstance(inner, list | Mapping) for inner in value.values()
        )
        found |= {f"{key}.{k}": v for k, v in _axes(value).items()} if plain else {key: value}
    return found


Words = Annotated[tuple[str, ...], BeforeValidator(_one_or_more), Field(strict=False, min_length=1)]


class StudyFile(Config):
    """The keys of a study file; docs/studies.md explains each."""

    name: Word
    scenario: Words
    estimators: Words
    seeds: Annotated[tuple[int, ...], BeforeValidator(_numbers), Field(strict=False)]
    override: Annotated[dict[str, Any], BeforeValidator(_flat)] = Field(default_factory=dict)
    sweep: Annotated[dict[str, Any], BeforeValidator(_axes)] = Field(default_factory=dict)
    design: Literal["product", "list", "sobol", "latin"] = "product"
    samples: Annotated[int, Field(ge=1, le=MOST)] | None = None
    design_seed: Annotated[int, Field(ge=0, lt=END)] = 0
    streams: Literal["common", "own"] = "common"
    twins: bool = True


def load_study(path: str | os.PathLike[str]) -> Study:
    """Return the study in a TOML file; scenario files are looked for beside it.

    Raises
    ------
    StudyError
        With one line for each problem, naming file and key.
    """
    path = Path(path)
    content = read_toml(path, StudyError)
    return study_from({"name": path.stem} | content, source=str(path), folder=path.parent)


def study_from(
    content: Mapping[str, Any], *, source: str = "study", folder: Path | None = None
) -> Study:
    """Return a study from keys and values, as from a TOML file.

    Parameters
    ----------
    content : mapping
    source : str
        What to call it in messages.
    folder : Path, optional
        Where scenario files are looked for before the current folder.

    Raises
    ------
    StudyError
        With one line for each problem.
    """
    try:
        file = StudyFile.model_validate(dict(content))
    except ValidationError as error:
        raise _wrong(source, [*explain(error, StudyFile)]) from None
    problems: list[Problem] = [*_design_problems(file), *_estimator_problems(file)]
    scenarios = []
    for name in dict.fromkeys(file.scenario):
        try:
            scenarios.append(_scenario(name, folder).override(file.override))
        except ScenarioError as error:
            problems += [("scenario" if "unknown scenario" in p else name, p)
                         for p in error.problems]  # fmt: skip
    if problems:
        raise _wrong(source, problems)
    return Study(
        name=file.name,
        scenarios=tuple(scenarios),
        estimators=tuple(dict.fromkeys(file.estimators)),
        seeds=file.seeds,
        axes=tuple(file.sweep),
        points=tuple([*_points(file), *_twins(file)]),
        streams=file.streams,
    )


def _scenario(name: str, folder: Path | None) -> Scenario:
    beside = folder / name if folder else None
    return find_scenario(str(beside) if beside and os.path.isfile(beside) else name)


def _points(file: StudyFile) -> list[Point]:
    if file.design in DRAWN:
        spans = {key: Span.model_validate(value) for key, value in file.sweep.items()}
        return sample(spans, file.samples or 1, file.design_seed, file.design)
    return (product if file.design == "product" else listed)(file.sweep) or [{}]


def _twins(file: StudyFile) -> Iterator[Point]:
    """Yield the points of a product with a fault of no size (factor 1) in its place, each once.

    On the same streams they are the twins without it: what is found there is found by chance.
    """
    for size in filter(SIZE.fullmatch, file.sweep):
        if (
            file.twins
            and file.streams == "common"
            and file.design == "product"
            and 1.0 not in file.sweep[size]
        ):
            yield from product({**file.sweep, size: [1.0]})


def _design_problems(file: StudyFile) -> Iterator[Problem]:
    if (file.design in DRAWN) != (file.samples is not None):
        yield "samples", 'the number of points, goes with design = "sobol" or "latin" only'
    if file.design != "product" and not file.sweep:
        yield "sweep", f"design = {file.design!r} needs at least one axis"
    check = _span_problem if file.design in DRAWN else _values_problem
    for key, value in file.sweep.items():
        if not (_first(key) in Scenario.model_fields or is_option(key, file.estimators)):
            near = _near(key, file.estimators)
            yield (
                f"sweep.{key}",
                f"neither a key of a scenario nor an option of an estimator.{near}",
            )
        elif problem := check(value):
            yield f"sweep.{key}", problem
    lengths = {key: len(v) for key, v in file.sweep.items() if isinstance(v, list)}
    if file.design == "product" and math.prod(lengths.values()) > MOST:
        told = " × ".join(f"{n} values of {key}" for key, n in lengths.items())
        yield "sweep", f"{told} are too many points: at most {MOST} in all"
    if file.design == "list" and len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} has {n}" for key, n in lengths.items())
        yield "sweep", f'design = "list" takes all axes in step, so of one length: {told}'


def _values_problem(value: Any) -> str | None:
    if isinstance(value, Mapping):
        return 'a table of low and high goes with design = "sobol"; give an array of values'
    if not (isinstance(value, list) and value):
        return f"must be an array of values, not {value}"
    other = next((entry for entry in value if not _storable(entry)), None)
    return other and f"{other} is no number, text, truth or array or table of them"


def _storable(value: Any) -> bool:
    """Return whether a value can stand in a row, which is JSON: no date, and no infinity."""
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return False
    return True


def _span_problem(value: Any) -> str | None:
    try:
        span = Span.model_validate(value)
    except ValidationError as error:
        told = "; ".join(f"{key or 'it'}: {text}" for key, text in explain(error, Span))
        return f'must be {{ low = …, high = … }} for design = "sobol": {told or repr(value)}'
    if not span.low < span.high:
        return f"low = {span.low:g} must be below high = {span.high:g}"
    return "log = true needs low above 0" if span.log and span.low <= 0 else None


def _estimator_problems(file: StudyFile) -> Iterator[Problem]:
    for text in dict.fromkeys(file.estimators):
        try:  # what names code is tried with the plan, if it may run
            specs.written_options(text) if names_code(text) else specs.parse(text)
        except EstimatorError as error:
            yield "estimators", str(error)


def _first(key: str) -> str:
    return re.split(r"[.\[]", key)[0]


def _near(key: str, estimators: tuple[str, ...]) -> str:
    option = key.rpartition(".")[2]
    names = [text.partition("[")[0].strip() for text in estimators]
    options = [f"{name}.{option}" for name in [*names, ALL]]
    return did_you_mean(key, options) or did_you_mean(_first(key), Scenario.model_fields)


def _wrong(source: str, problems: list[Problem]) -> StudyError:
    lines = [f"{source}: {key}: {line}" for key, text in problems for line in text.splitlines()]
    return StudyError("\n".join(dict.fromkeys(lines)))
