"""What the claims are checked on: MuJoCo runs, and what estimators made of them.

No estimator is tuned on the seeds. Everything is computed once it is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline import priors
from flexaxis.estimators.offline.frequency import information, line_spectrum
from flexaxis.estimators.offline.output_error import Identified, output_error
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.priors import steady_P
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.experiments.studies.definition import FIRST
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Adaptation = Mapping[str, Any]
"""What is chosen in the recursive method, as `Rpem` takes it: λ or Δ."""

FAULTS = {"k_T": "kt_step-v1", "1/J_a": "ja_step-v1", "f_m": "fm_step-v1"}
"""The step-fault scenario of each identified parameter."""
SMALL = {"k_T": 0.97, "1/J_a": 1.02, "f_m": 1.1}
"""Factors on k_T, J_a and f_m that are small enough for a linear theory, well above the noise."""
PAUSE = (10.0, 30.0)
"""Standstill of the scenario that shows windup [s]."""
FORGETTING = 0.995
METHODS = ("forgetting", "modification")
SIZES = {"nominal": 30, "long": 8, "others": 16}
"""Runs of the paper's experiment; of 60 s of it; of each standstill or fault."""
STRIDE = 20
"""Samples from one kept P to the next."""


class Runs(NamedTuple):
    """What the recursive method did on S records of N samples.

    Attributes
    ----------
    theta : ndarray (S, N, p)
        Estimates over nominal.
    P : ndarray (S, N/STRIDE, p)
        Diagonal of P(t+1|t), every so many samples.
    """

    theta: Array
    P: Array


class Evidence:
    """Everything that was simulated and estimated.

    Parameters
    ----------
    first : int
        Seed of the first run.
    sizes : mapping of str to int
        As `SIZES`.
    store : RecordCache, optional
        Where records are kept.

    Attributes
    ----------
    scenario : Scenario
        The paper's experiment.
    scenarios : dict of str to Scenario
        That (``"nominal"``), 60 s of it (``"long"``), with a standstill and θ(0) at the truth
        (``"pause"``), with a step fault (by the identified parameter that it changes), and with a
        small one (such as ``"small f_m"``).
    onset : int
        First sample after each of the faults.
    model : Parametrization
        The nominal axis as a function of the identified parameters, with nominal values `theta`.
    adaptations : dict of str to Adaptation
        By method: the paper's λ, and Δ of eq. (32); and slower ones.
    """

    def __init__(
        self,
        *,
        first: int = FIRST,
        sizes: Mapping[str, int] = SIZES,
        store: RecordCache | None = None,
    ) -> None:
        self.first, self.sizes, self._store = first, sizes, store
        self.scenario = scenario = find_scenario("paper_nominal-v1")
        self.period, self.names = scenario.period, scenario.identify
        self.excitation: Any = scenario.excitation
        self.axis = three_mass(scenario.nominal.as_dict())
        self.model = self.axis.parametrize(self.names)
        self.drift = np.array([*priors.DRIFT.values()])
        self.adaptations: Mapping[str, Adaptation] = {
            "forgetting": {"forgetting": FORGETTING},
            "modification": {"drift": self.drift},
            "slow forgetting": {"forgetting": 0.999},
            "slow modification": {"drift": self.drift / 16},  # a quarter of the speed
        }
        pause = {"start": 1.0, "duration": 45.0, "excitation.pause": [list(PAUSE)]}
        self.scenarios = {
            "nominal": scenario,
            "long": scenario.override({"duration": 60.0}),
            "pause": scenario.override(pause),
        }
        for name, text in FAULTS.items():
            self.scenarios[name] = fault = find_scenario(text)
            self.scenarios[f"small {name}"] = fault.override({"fault[0].factor": SMALL[name]})
            self.onset = fault.events()[0].index

    @cache  # noqa: B019
    def records(self, group: str) -> list[Any]:
        """Return the records of one of `scenarios`."""
        number = self.sizes.get(group, self.sizes["others"])
        seeds = range(self.first, self.first + number)
        return records(self.scenarios[group], seeds, self._store)

    @cached_property
    def reference(self) -> Array:
        """Torque (8000,) [N m] of a run at nominal parameters that is not among the records."""
        return nominal_torque(self.scenario)

    def predict(self, torque: Array) -> tuple[Array, Array]:
        """Return ŷ (N,) and ψ (N, p) at nominal parameters for a torque (N,)."""
        return predict(self.model, self.model.theta, torque, period=self.period)

    def steady(self, signal: Array) -> Array:
        """Return the last two periods of a signal (N, …), in which no transient is left."""
        return signal[-2 * round(self.excitation.period / self.period) :]

    def lines(self, torque: Array) -> tuple[Array, Array]:
        """Return frequency [rad/s] and power of the lines of a torque (N,)."""
        return line_spectrum(self.steady(torque), period=self.period)

    def information(self, torque: Array) -> Array:
        """Return E ψψᵀ (p, p) at nominal parameters by the spectrum of a torque, eq. (28), (31)."""
        lines = self.lines(torque)
        return information(self.model, self.model.theta, *lines, period=self.period)

    @cached_property
    def Q(self) -> Array:
        """E ψψᵀ (p, p) of the reference torque."""
        return self.information(self.reference)

    def steady_P(self, adaptation: Adaptation) -> Array:
        """Return P (p, p) of eq. (29) or (30)."""
        return steady_P(self.Q, **adaptation)

    @cache  # noqa: B019
    def recipe(self, method: str) -> Array:
        """Return the diagonal of P(0) (p,) by the recipe of section 5.2."""
        known: Any = {"identify": self.names, "period": self.period, **self.adaptations[method]}
        return priors.nominal_P(self.axis, self.reference, **known)

    @cache  # noqa: B019
    def runs(self, method: str) -> Runs:
        """Return runs of a method: from 1.2 times nominal; slow ones over 60 s, from nominal."""
        adaptation = self.adaptations[method]
        if method not in METHODS:
            return self.filtered("long", adaptation)
        P0 = self.recipe(method)
        return self.filtered("nominal", adaptation, P0=P0, start=self.scenario.start)

    def filtered(
        self,
        group: str,
        adaptation: Adaptation,
        *,
        P0: Any = None,
        start: float = 1.0,
        mu: float = 0.0,
    ) -> Runs:
        """Run the recursive prediction-error method on each record of a group.

        Parameters
        ----------
        group : str
        adaptation : Adaptation
        P0 : ndarray (p,), optional
            By default that of eq. (29) or (30).
        start : float
            θ(0) over nominal.
        mu : float
            μ of eq. (12).
        """
        theta, P = [], []
        P0 = self.steady_P(adaptation) if P0 is None else P0
        known: Any = {
            "identify": self.names,
            "period": self.period,
            "ceiling": np.inf,
            **adaptation,
        }
        nominal = self.model.theta
        estimator = Rpem(self.axis, theta0=start * nominal, P0=P0, regularization=mu, **known)
        for record in self.records(group):
            estimator.reset()
            parts = [signal.reshape(-1, STRIDE) for signal in signals(record)]
            for u, y in zip(*parts, strict=True):
                theta.append(estimator.run(u, y))
                P.append(np.diag(estimator.P))
        shape = len(self.records(group)), -1, len(self.names)
        return Runs(np.reshape(theta, shape) / nominal, np.reshape(P, shape))

    def identified(self, names: Sequence[str], start: float, record: int = 0) -> Identified:
        """Identify parameters off line from a run of 60 s, started at so many times nominal."""
        theta = start * self.axis.parametrize(names).theta
        known: Any = {"period": self.period, "max_evaluations": 30, "start": theta}
        u, y = signals(self.records("long")[record])
        return output_error(self.axis, u, y, identify=names, **known)

    @cached_property
    def offline(self) -> list[Identified]:
        """The three parameters from 1.2 times nominal, on each record of 60 s."""
        return [self.identified(self.names, 1.2, i) for i in range(len(self.records("long")))]

    @cached_property
    def physical(self) -> Identified:
        """All parameters but r and k_T, which sets the scale."""
        return self.identified(self.all_but("r", "k_T"), 1.2)

    def all_but(self, *names: str) -> tuple[str, ...]:
        """Return the parameters of the axis without some."""
        return tuple(name for name in self.axis.parameters if name not in names)


def signals(record: Record) -> Any:
    """Return torque [N m] and measured speed [rad/s] of a record, (N,) each."""
    return record.torque, record.speed
