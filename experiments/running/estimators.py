"""Create estimators from the value of the option `--estimator` and the properties of an axis.

The option value is the name of a registered estimator, the name of an entry point in the group
`flexaxis.estimators`, ``path/file.py:Class``, or ``package.module:Class``. Estimator options follow
in brackets, in TOML syntax (``rpem-forgetting[forgetting=0.99]``). With ``--estimator
pipe:COMMAND``, the estimator is a program in any language.
"""

import inspect
import json
import pickle
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from hashlib import sha256
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axis_models import MODELS
from flexaxis.estimators.offline.priors import stored_P
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.running.cache import SHORT
from flexaxis.experiments.running.user_code import (
    PIPE,
    PipeEstimator,
    code_file,
    load_class,
    names_code,
    reported,
    user_line,
)
from flexaxis.experiments.scoring.parameter_names import check_model, known_names, started_nominal
from flexaxis.models_mjcf import DEFAULT
from flexaxis.sim.conflicts import estimated_problems
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.parameters import ESTIMATED_ONLY, LAW_NAMES
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.text_files import shown, toml_tables

GROUP = "flexaxis.estimators"
KEPT = 48  # number of registered estimators that a process caches
Factory = Callable[..., Any]


class Misfit(EstimatorError):
    """Error if a valid estimator cannot run on a valid scenario."""


@dataclass(frozen=True)
class Spec:
    """Specification of an estimator.

    Attributes
    ----------
    text : str
        Value of the option `--estimator`.
    options : mapping
        Options of the estimator, keyed by name.
    session : callable or None
        Class of the estimator if it was defined in an interactive session rather than in a file.
    """

    text: str
    options: Mapping[str, Any] = field(default_factory=dict)
    session: Factory | None = None

    @property
    def name(self) -> str:
        """The estimator specification without the options in brackets."""
        return self.text if self.text.startswith(PIPE) else self.text.partition("[")[0].strip()

    @property
    def is_users(self) -> bool:
        """Whether the estimator is user code, such as a file, a program or an entry point."""
        return self.session is not None or self.name not in REGISTRY

    @property
    def make(self) -> Factory:
        """The class or factory function of the estimator; this property imports user code."""
        if self.text.startswith(PIPE):
            return partial(PipeEstimator, self.text.removeprefix(PIPE))
        if self.session is not None:
            return self.session
        if self.name in REGISTRY:
            return REGISTRY[self.name].factory
        if names_code(self.text):
            return load_class(self.name)
        with reported(self.text, "during import"):
            return _installed()[self.name].load()  # type: ignore[no-any-return]

    @cached_property
    def digest(self) -> str | None:
        """Digest of user code, or None for a registered estimator or an entry point.

        The digest covers the file that defines the class, all files that the pipe command names, or
        the source code of a class from an interactive session.
        """
        if self.session is not None:
            content = _source(self.session)
        elif names_code(self.text):
            files = filter(Path.is_file, map(Path, _words(self.name)))
            content = b"".join(map(Path.read_bytes, files))
        else:
            return None
        return sha256(content).hexdigest()[:SHORT]


def _source(make: Factory) -> bytes:
    try:
        return inspect.getsource(make).encode()
    except (OSError, TypeError):  # the class was typed into an interpreter
        return bytes(cloudpickle.dumps(make))


def _words(name: str) -> list[str]:
    """Return the words of a pipe command or, for a class, a list with only the path of its file."""
    if name.startswith(PIPE):
        return shlex.split(name.removeprefix(PIPE))
    return [code_file(name) or getattr(find_spec(name.rpartition(":")[0]), "origin", None) or ""]


_session: dict[str, Factory] = {}


def text_of(make: str | Factory) -> str:
    """Return the text that identifies an estimator class; return a string argument unchanged."""
    if isinstance(make, str):
        return make
    name, module = getattr(make, "__name__", ""), getattr(make, "__module__", "__main__")
    if not name.isidentifier() or name in REGISTRY:
        raise EstimatorError(
            f"{make!r}: give either the name of a registered estimator, such as 'glr', or your own "
            "class, with a name that is not yet registered. An instance of a class is not "
            "accepted, because each run needs a new instance"
        )
    home = sys.modules.get(module)
    if module != "__main__" and getattr(home, name, None) is make and home.__spec__:  # type: ignore[union-attr]
        return f"{module}:{name}"
    _session[name] = make
    return name


def parse(text: str) -> Spec:
    """Parse the value of the option `--estimator` without importing user code.

    Raises
    ------
    EstimatorError
        If `text` names an estimator, a file or an option that does not exist.
    """
    if text.startswith(PIPE):  # brackets are part of the command
        return Spec(text)
    spec = Spec(text, written_options(text), _session.get(text.partition("[")[0].strip()))
    name = spec.name
    if (file := code_file(name)) and not Path(file).is_file():
        raise EstimatorError(f"the estimator file {file} does not exist")
    ours = name in REGISTRY or spec.session or names_code(name)
    if not ours and name not in (installed := _installed()):
        raise EstimatorError(
            f"unknown estimator {name!r}.{did_you_mean(name, [*REGISTRY, *installed])} Run "
            "`flexaxis list estimators` to list all estimators. To use your own estimator, give "
            "path/file.py:Class, package.module:Class or pipe:COMMAND"
        )
    if name in REGISTRY:
        keywords(spec)
    return spec


def _installed() -> dict[str, Any]:
    return {point.name: point for point in entry_points(group=GROUP)}


def written_options(text: str) -> dict[str, Any]:
    """Return the options in the brackets after an estimator name.

    Raises
    ------
    EstimatorError
        If the options are not valid TOML.

    Examples
    --------
    >>> written_options("mine.py:Mine[gain=0.1]")
    {'gain': 0.1}
    """
    rest = "" if text.startswith(PIPE) else text.partition("[")[2]
    source = f"{shown(text)}: write options in the form [forgetting=0.99, regularization=1e-6]"
    table = "options = {" + rest.removesuffix("]") + "}"
    return toml_tables(table, source=source, refuse=EstimatorError)["options"] if rest else {}


def with_options(text: str, options: Mapping[str, Any]) -> str:
    """Add or replace options in an estimator specification, and return the new specification.

    Examples
    --------
    >>> with_options("ekf[walk=0.1]", {"walk": 0.002})
    'ekf[walk=0.002]'
    """
    if not options:
        return text
    every = written_options(text) | dict(options)
    inside = ",".join(f"{key}={_written(value)}" for key, value in every.items())
    return f"{text.partition('[')[0].strip()}[{inside}]"


def _written(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.12g}"
    return json.dumps(value, default=lambda numpys: numpys.tolist())


def keywords(spec: Spec) -> set[str]:
    """Return the names of the optional arguments of an estimator's constructor.

    Raises
    ------
    EstimatorError
        If the specification contains an option that the constructor does not accept.
    """
    parameters = list(inspect.signature(spec.make).parameters.values())[2:]
    known = {p.name for p in parameters if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)}
    for key in spec.options:
        if key not in known:
            raise EstimatorError(
                f"{spec.name} has no option {key!r}.{did_you_mean(key, known)} The options of "
                f"this estimator are: {', '.join(sorted(known)) or 'none'}"
            )
    return known


def make_estimator(spec: Spec, nominal: Any, period: float, **known: Any) -> Estimator:
    """Construct an estimator from nominal values (a mapping or a model) and a sampling period.

    The constructor receives each entry of `known` whose key is one of its keyword arguments.
    Options in the specification override the entries of `known`.

    Raises
    ------
    EstimatorError
        If the constructor rejects an option, or if the constructed object is not an estimator.
    EstimatorCrash
        If the constructor raises any other exception.
    """
    names = keywords(spec)
    known = {key: value for key, value in known.items() if key in names} | dict(spec.options)
    with reported(spec.text, "in its constructor", refusing=True):
        try:
            estimator = spec.make(nominal, period, **known)
        except (TypeError, ValueError) as error:
            if isinstance(error, EstimatorError) or user_line(error):
                raise
            raise EstimatorError(f"{spec.text}: {error}") from error  # an option was refused
        if not isinstance(estimator, Estimator) or not len(estimator.names):
            raise EstimatorError(
                f"{spec.text}: an estimator needs the attributes `names` and `output`, and the "
                "method `step`"
            )
    return estimator


def build(spec: Spec, scenario: Scenario) -> Estimator:
    """Construct an estimator from the scenario properties that estimators are allowed to know.

    The constructor receives the sampling period and the nominal parameters. The nominal values of
    identified parameters are scaled by the factor `start` of the scenario. The nominal parameters
    also include data-sheet values. The constructor also receives each of the arguments `identify`,
    `output`, `noise` and `torque` that it accepts. The constructor receives `noise` only if the
    data sheet of the scenario contains a noise level. The argument `torque` is the torque of a
    nominal run, from which estimators compute the initial covariance P(0). Registered estimators
    are cached and copied, because constructing an estimator takes as long as a run. A user-written
    estimator is constructed anew for each run.

    Raises
    ------
    EstimatorError
        If an option is rejected, or if the estimator cannot run on the scenario (`Misfit`).
    EstimatorCrash
        If the constructor raises any other exception.
    """
    check_model(scenario)
    nominal = started_nominal(scenario)
    known = _known(spec, scenario, nominal)
    if spec.is_users:
        estimator = make_estimator(spec, nominal, scenario.period, **known)
    else:
        key = pickle.dumps((spec.text, scenario.model, nominal, scenario.period, known))
        estimator = _registered(key).copy()
    _check_fits(spec.text, estimator, scenario)
    return estimator


@lru_cache(KEPT)
def _registered(key: bytes) -> Any:
    """Construct and compile a registered estimator with the constructor arguments in `key`."""
    text, model, nominal, period, known = pickle.loads(key)
    axis = nominal if model == DEFAULT else MODELS[model].factory(nominal)
    estimator: Any = make_estimator(parse(text), axis, period, **known)
    run_estimator(estimator, np.zeros(2), np.zeros(2))  # compile before the time is measured
    estimator.reset()
    return estimator


def _known(spec: Spec, scenario: Scenario, nominal: Mapping[str, float]) -> dict[str, Any]:
    """Return keyword arguments for an estimator's constructor, such as `identify`."""
    from flexaxis.experiments.scoring.nominal_torque import design_torque, nominal_torque

    laws = bool(getattr(REGISTRY.get(spec.name, spec.make), "laws", False))
    identify = tuple(n for n in scenario.identify if laws or n not in LAW_NAMES)
    if not identify:
        raise Misfit(
            f"{scenario.name} identifies only {', '.join(scenario.identify)}, but {spec.text} "
            "cannot estimate these parameters, because the estimator does not declare the "
            "attribute `laws`. Omit the scenario"
        )
    known: dict[str, Any] = {"identify": identify, "output": scenario.output}
    if (noise := scenario.data_sheet.get("noise")) is not None:
        known["noise"] = noise
    if spec.name == "oracle-reset":  # this baseline knows the fault times
        known["onsets"] = tuple(event.index for event in scenario.events())
    if "torque" in keywords(spec) and "P0" not in spec.options:
        model = MODELS[scenario.model].factory(nominal)
        if laws:  # the scale of friction is computed from the torque
            known["torque"] = design_torque(scenario)
        elif spec.is_users or stored_P(model, identify, scenario.period, forgetting=None) is None:
            known["torque"] = nominal_torque(scenario)
    return known


def _check_fits(text: str, estimator: Estimator, scenario: Scenario) -> None:
    """Raise an error if an estimator cannot run on a scenario, or if no estimate can be scored."""
    names, besides = tuple(estimator.names), (*LAW_NAMES, *ESTIMATED_ONLY)
    problems = estimated_problems(names, scenario, key="names", besides=besides)
    if lines := [f"{text}: {key}: {problem}" for key, problem in problems]:
        raise EstimatorError("\n".join(lines))
    if estimator.output != scenario.output or not known_names(scenario, names):
        raise Misfit(
            f"{text} reads the output {estimator.output!r} and estimates {', '.join(names)}, but "
            f"{scenario.name} provides the output {scenario.output!r} and contains the parameters "
            f"{', '.join(scenario.parameter_names)}. Change the `output` of the estimator, or "
            "omit the scenario"
        )
