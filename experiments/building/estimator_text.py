"""From the text of an `--estimator` option to a built estimator.

Forms: a name of the registry, ``path/file.py:Class``, ``package.module:Class``, or the name of
an entry point in the group `flexaxis.estimators`; each with options in brackets, written as in
TOML: ``rpem-forgetting[forgetting=0.99, regularization=1e-6]``. And ``pipe:COMMAND``, a program in
any language. All but the first run the code they name, so that text which was not typed on the
command line goes through `flexaxis.experiments.building.code` before it comes here.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.away import Away
from flexaxis.experiments.building.code import given, piped
from flexaxis.experiments.building.crashes import user_code
from flexaxis.experiments.building.guest import hosted, is_away, is_guest
from flexaxis.experiments.building.imports import class_of, imported, no_file
from flexaxis.experiments.building.offer import (
    Misfit,
    Nominal,
    Offer,
    Torques,
    keywords,
    offer_of,
    offered_to,
    torque_of,
)
from flexaxis.experiments.building.pipe import PipeEstimator
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.law_parameters import ESTIMATED_ONLY, LAW_NAMES
from flexaxis.sim.storage.reading import shown, toml_tables

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario

ENTRY_POINTS = "flexaxis.estimators"


@dataclass(frozen=True)
class Spec:
    """An estimator to be built: the text that names it, what makes it, and its options."""

    text: str
    make: Callable[..., Estimator]
    options: Mapping[str, Any]


def parse(text: str) -> Spec:
    """Return what an `--estimator` option stands for; nothing is built yet.

    Raises
    ------
    EstimatorError
        If there is no such estimator or option, or its file cannot be imported.
    """
    if command := piped(text):  # brackets are part of the command
        return Spec(text, partial(PipeEstimator, command), {})
    name, _, rest = text.partition("[")
    make = _find(name.strip())
    options = _options(rest, text)
    known = keywords(make, name)
    for key in options:
        if key not in known:
            raise EstimatorError(
                f"{name} has no option {key!r}.{did_you_mean(key, known)} "
                f"It has: {', '.join(sorted(known)) or 'none'}"
            )
    return Spec(text, make, options)


def written_options(text: str) -> dict[str, Any]:
    """Return the options that stand in an `--estimator` option; nothing is looked up or run.

    Raises
    ------
    EstimatorError
        If they are not written as in TOML.

    Examples
    --------
    >>> written_options("mine.py:Mine[gain=0.1]")
    {'gain': 0.1}
    """
    return {} if piped(text) else _options(text.partition("[")[2], text)


def build(spec: Spec, scenario: Scenario) -> Estimator:
    """Return the estimator, told what an estimator may know of a scenario.

    That is the nominal parameters (with the scenario's `start` on the identified ones, and with
    what its data sheet says) and the period; and, where its constructor has keywords of these
    names, `identify`, `output`, `noise` (where the scenario has told.noise) and `torque` (a
    nominal reference run, from which a P(0) can be computed). Parameters of friction and other
    laws that a scenario asks for are asked of those alone that declare `laws`.

    Raises
    ------
    EstimatorError
        If an option is refused, `names` cannot be scored on this scenario, or the estimator reads
        another output than the scenario gives.
    EstimatorCrash
        If its constructor raises anything.
    """
    onsets = tuple(event.index for event in scenario.events())
    estimator = build_of(spec, offer_of(scenario), partial(torque_of, scenario), onsets=onsets)
    check_fits(spec.text, estimator.names, estimator.output, scenario)
    return estimator


def build_of(
    spec: Spec, offer: Offer, torques: Torques, *, onsets: Sequence[int] = ()
) -> Estimator:
    """Return an estimator, given what it may know as plain values: no scenario is at hand.

    Parameters
    ----------
    spec : Spec
    offer : Offer
    torques : callable
        Gives the torque of a nominal reference run, where the estimator asks for one.
    onsets : sequence of int
        Samples of the faults, for the control that is told them.

    Raises
    ------
    EstimatorError
        If an option is refused, or nothing is asked that it could estimate.
    EstimatorCrash
        If its constructor raises anything.
    """
    given = offered_to(spec, offer, torques, onsets=onsets)
    return made(spec, offer.axis(spec.text), offer.period, given)


def check_fits(text: str, names: Sequence[str], output: str, scenario: Scenario) -> None:
    """Refuse an estimator that a scenario cannot be read or scored with.

    Raises
    ------
    EstimatorError
        If `names` cannot be scored, or it reads another output than the scenario gives.
    """
    _check_names(text, names, scenario)
    if output != scenario.output:
        raise Misfit(
            f"{text} reads {output!r}, but {scenario.name} gives "
            f"{scenario.output!r}: set its `output` to that, or leave the scenario out"
        )


def made(
    spec: Spec, nominal: Any, period: float, offered: Mapping[str, Any] | None = None
) -> Estimator:
    """Return an estimator; whatever is built by name is built here, and refused in these words.

    Parameters
    ----------
    spec : Spec
    nominal : mapping of str to float, or a model
        What its constructor takes.
    period : float
        [s].
    offered : mapping, optional
        Given to it where it has a keyword of that name; options of the spec go before.

    Raises
    ------
    EstimatorError
        If it refuses an option, or is no estimator.
    EstimatorCrash
        If its constructor raises anything else.
    """
    if isinstance(spec.make, Away):
        return spec.make(made, spec, nominal, period, offered)
    known = keywords(spec.make)
    given = {k: v for k, v in (offered or {}).items() if k in known} | dict(spec.options)
    _check_identify(spec)
    refused: Exception | None = None
    if is_guest(spec.text) and isinstance(nominal, Mapping):
        nominal = Nominal(nominal)
    with hosted(spec.text, "when it was made"):
        try:
            estimator = spec.make(nominal, period, **given)
        except (EstimatorError, TypeError, ValueError) as error:
            if not isinstance(error, EstimatorError) and user_code(error) is not None:
                raise
            refused = error  # it refuses an option, as a shipped one does
    if refused is not None:
        raise EstimatorError(f"{spec.text}: {refused}") from refused
    for attribute in ("names", "output", "step"):
        if not hasattr(estimator, attribute):
            raise EstimatorError(f"{spec.text}: an estimator needs `{attribute}`, this has none")
    names = estimator.names
    wrong = isinstance(names, str) or not isinstance(names, Sequence | np.ndarray)
    if wrong or not len(names) or not all(isinstance(name, str) for name in names):
        raise EstimatorError(
            f"{spec.text}: `names` must be a sequence of parameters, such as ('k_T', '1/J_a') or "
            f"('f_m',), not {names!r}"
        )
    return estimator


def _check_identify(spec: Spec) -> None:
    """Refuse what is no list of names: a number in it is found by no estimator as such."""
    given = spec.options.get("identify")
    if given is None:
        return
    if not (isinstance(given, list | tuple) and all(isinstance(name, str) for name in given)):
        raise EstimatorError(
            f"{spec.text}: identify is {given!r}; give names of parameters, such as "
            '["f_m", "1/J_a"]'
        )


def _check_names(text: str, names: Sequence[str], scenario: Scenario) -> None:
    """Refuse names that no score could be taken for."""
    from flexaxis.experiments.scoring.parameter_names import known_names
    from flexaxis.sim.tables.problems import estimated_problems

    if tuple(names) == scenario.identify:  # which was checked when the scenario was made
        return
    besides = (*LAW_NAMES, *ESTIMATED_ONLY)
    problems = estimated_problems(names, scenario.model_dump(), key="names", besides=besides)
    if lines := [f"{text}: {key}: {problem}" for key, problem in problems]:
        raise EstimatorError("\n".join(lines))
    if not known_names(scenario, names):
        raise Misfit(
            f"{text} estimates {', '.join(names)}, but {scenario.name} has "
            f"{', '.join(scenario.parameter_names)}: nothing of it could be scored"
        )


def _options(rest: str, text: str) -> dict[str, Any]:
    if not rest:
        return {}
    options = "options = {" + rest.removesuffix("]") + "}"
    source = f"{shown(text)}: write options as in [forgetting=0.99, regularization=1e-6]"
    return toml_tables(options, source=source, refuse=EstimatorError)["options"]


def _find(name: str) -> Callable[..., Estimator]:
    if name in REGISTRY:
        return REGISTRY[name].factory
    if (held := given(name)) is not None:
        return held
    module, colon, attribute = name.rpartition(":")
    if colon:
        return _class_away(name) if is_away(name) else class_of(module, name, attribute)
    installed = {point.name: point for point in entry_points(group=ENTRY_POINTS)}
    if name in installed:
        return imported(name, installed[name].load)
    raise EstimatorError(
        f"unknown estimator {name!r}.{did_you_mean(name, [*REGISTRY, *installed])} `flexaxis list` "
        "shows them; your own is path/file.py:Class, package.module:Class or pipe:COMMAND"
    )


def _class_away(name: str) -> Away:
    """Return the class of ``path/file.py:Class`` or ``package.module:Class``, in its process."""
    module, _, attribute = name.rpartition(":")
    if module.endswith(".py"):
        if not Path(module).is_file():
            raise no_file(Path(module))
        module = str(Path(module).resolve())
    found = Away(module, name, (module, name, attribute))
    found.__signature__ = found.there(_signature, name)
    return found


def _signature(found: Callable[..., Any], name: str) -> inspect.Signature:
    """Return how a class is made; asked first, so that a process has this module before its code.

    Not where a process takes the place of another: to that ours is new after a user's code.
    """
    keywords(found, name)
    known = inspect.signature(found).parameters.values()
    return inspect.Signature([p.replace(annotation=p.empty) for p in known])
