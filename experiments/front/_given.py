"""What a caller gives: an estimator as text or class, scenarios, seeds; what these stand for."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.catalogue.find import select
from flexaxis.experiments.running.estimators import Spec, parse, with_options
from flexaxis.experiments.running.estimators import text_of as text_of_class
from flexaxis.experiments.seeds import MOST_SEEDS, check_number, check_seed, parse_seeds
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Estimators = str | Callable[..., Any] | Iterable[str | Callable[..., Any]]
Scenarios = str | os.PathLike[str] | Scenario | Iterable[str | os.PathLike[str] | Scenario]


def spec_of(estimator: str | Callable[..., Any], options: Mapping[str, Any] | None = None) -> Spec:
    """Return what builds an estimator, from its text or its class, with some options set."""
    return parse(with_options(text_of(estimator), options or {}))


def text_of(estimator: str | Callable[..., Any]) -> str:
    """Return an estimator as text, as for `--estimator`."""
    if isinstance(estimator, str):
        return estimator
    if estimator is None:
        raise EstimatorError("no estimator was given: give its name, such as 'glr', or its class")
    made = hasattr(estimator, "step") and not isinstance(estimator, type)
    if made or not callable(estimator):
        raise EstimatorError(
            f"{type(estimator).__name__} object: each run needs an estimator of its own, so give "
            "its name or its class, not an instance"
        )
    return text_of_class(estimator)


def texts_of(estimators: Estimators) -> tuple[str, ...]:
    """Return some estimators as text, each once.

    Raises
    ------
    EstimatorError
        If there is none or an instance among them, or if two classes have one name.
    """
    several = isinstance(estimators, Iterable) and not isinstance(estimators, str | type)
    wanted: list[Any] = list(estimators) if several else [estimators]  # type: ignore[arg-type]
    if not wanted:
        raise EstimatorError("no estimator was given: give at least one, such as 'glr'")
    texts = [text_of(one) for one in wanted]
    _check_names(wanted, texts)
    return tuple(dict.fromkeys(texts))


def _check_names(wanted: Sequence[Any], texts: Sequence[str]) -> None:
    """Refuse two classes of one text, for their rows could not be told apart."""
    seen: dict[str, Any] = {}
    for one, text in zip(wanted, texts, strict=True):
        other = seen.setdefault(text, one)
        if not isinstance(one, str) and other is not one:
            raise EstimatorError(
                f"two classes have the name {text}, {_whole(other)} and {_whole(one)}: their rows "
                "could not be told apart, so rename one"
            )


def _whole(make: Any) -> str:
    return f"{getattr(make, '__module__', '')}.{getattr(make, '__qualname__', make)}".lstrip(".")


def scenarios_of(scenarios: Scenarios) -> tuple[Scenario, ...]:
    """Return scenarios by their names, those of suites, those from files, or as they are."""
    one = isinstance(scenarios, str | os.PathLike | Scenario)
    if not (one or isinstance(scenarios, Iterable)) or isinstance(scenarios, bytes):
        raise FlexaxisError(
            f"{scenarios!r} is no scenario: give a name, such as 'fm_step-v1', a path, or several"
        )
    wanted: list[Any] = [scenarios] if one else list(scenarios)  # type: ignore[arg-type]
    found: list[Scenario] = []
    for each in wanted:
        found += [each] if isinstance(each, Scenario) else select([str(each)]).scenarios
    if not found:
        raise FlexaxisError("no scenario was given: give at least one, such as 'fm_step-v1'")
    return tuple({scenario.hash: scenario for scenario in found}.values())


def seeds_of(seeds: int | str | Iterable[int]) -> tuple[int, ...]:
    """Return seeds: a number of them from 1000 on, a range as text, or those listed.

    Examples
    --------
    >>> seeds_of(2), seeds_of("5:7"), seeds_of(range(3))
    ((1000, 1001), (5, 6), (0, 1, 2))
    """
    if isinstance(seeds, str) or _whole_number(seeds):
        return tuple(parse_seeds(str(seeds), what="seeds"))
    if not isinstance(seeds, Iterable):
        raise FlexaxisError(
            f'seeds {seeds!r}: give a number of them, such as 8, a range as "0:20", or a list'
        )
    found = [seed_of(seed) for seed in islice(seeds, MOST_SEEDS + 1)]
    check_number(len(found))
    if not found:
        raise FlexaxisError("seeds []: give whole numbers from 0 on, at least one")
    if twice := [seed for seed, times in Counter(found).items() if times > 1]:
        raise FlexaxisError(
            f"seeds: {twice[0]} is given more than once, and gives the same run each time: give "
            "each once"
        )
    return tuple(found)


def seed_of(seed: Any) -> int:
    """Return the number of a run.

    Raises
    ------
    FlexaxisError
        If it is no whole number from 0 on.
    """
    check_seed(int(seed) if _whole_number(seed) else seed)
    return int(seed)


def _whole_number(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
