"""Run the MuJoCo simulations and compute the parameter estimates that test the paper's claims.

The seeds of the simulated runs were not used to tune any estimator. The module computes each record
and each estimate when it is first used.
"""

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline import priors
from flexaxis.estimators.offline.output_error import Identified, output_error
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.priors import drift_for, steady_P
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.cache import default_cache, records
from flexaxis.experiments.scoring.nominal_torque import nominal_torque
from flexaxis.experiments.studies.definition import FIRST
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
ByName = Mapping[str, Any]
Method = str | tuple[float, ...]

FAULTS = {"k_T": ("kt_step-v1", 0.97), "1/J_a": ("ja_step-v1", 1.02), "f_m": ("fm_step-v1", 1.1)}
"""Scenarios in which one parameter steps, and factors of smaller steps, keyed by parameter.

Each smaller step multiplies k_T, J_a or f_m by its factor. The smaller steps are small enough for
linear theory, but their effects are much larger than the noise.
"""
PAUSE = (10.0, 30.0)
"""Start and end time of the standstill in the scenario that demonstrates windup [s]."""
FORGETTING = 0.995
METHODS = ("forgetting", "modification")
SIZES = {"nominal": 30, "long": 8, "calm": 30, "others": 16}
"""Number of simulated runs for each scenario.

The scenario "nominal" is the experiment of the paper, and "long" is a longer experiment of 60 s. In
the scenario "calm", the estimates start at the true parameters. The entry "others" is the number of
runs for each scenario with a standstill or a fault.
"""
STRIDE = 20
"""Number of samples between successive stored values of the matrix P."""


class Runs(NamedTuple):
    """Results of the recursive prediction-error method for S records with N samples each.

    Attributes
    ----------
    theta : ndarray (S, N, p)
        Parameter estimates divided by nominal parameter values.
    P : ndarray (S, N/STRIDE, p)
        Diagonal of the matrix P(t+1|t) at every `STRIDE`-th sample.
    """

    theta: Array
    P: Array


class Evidence:
    """Simulated records, and parameter estimates from these records.

    Parameters
    ----------
    first : int
        Seed of the first run.
    sizes : mapping of str to int
        Number of runs for each key of `SIZES`.

    Attributes
    ----------
    scenario : Scenario
        Scenario that represents the experiment of the paper.
    scenarios : dict of str to Scenario
        Scenarios, keyed by name. The scenario ``"nominal"`` is the experiment of the paper. In all
        other scenarios, the estimates start at the true parameters. The scenario ``"calm"`` differs
        from ``"nominal"`` only in the initial estimates. The scenario ``"long"`` lasts 60 s, and
        ``"pause"`` contains a standstill. A scenario such as ``"f_m"`` contains a step fault of a
        parameter, and ``"small f_m"`` contains a smaller step.
    onset : int
        Index of the first sample with the fault. All scenarios with a fault have the same onset
        time.
    model : Parametrization
        Model of the nominal axis as a function of the identified parameters.
    theta : ndarray (p,)
        Nominal values of the identified parameters.
    adaptations : dict of str to dict
        Options of the class `Rpem`, keyed by the name of the method. The methods are forgetting
        with the λ of the paper, covariance modification with the Δ of equation (32), and a slower
        variant of each. Wherever a method name is expected, a tuple with one time constant per
        parameter [s] is also allowed.
    """

    def __init__(self, *, first: int = FIRST, sizes: Mapping[str, int] = SIZES) -> None:
        self.first, self.sizes = first, sizes
        self.scenario = scenario = find_scenario("paper_nominal-v1")
        self.period, self.names = scenario.period, scenario.identify
        self.excitation: Any = scenario.excitation
        self.axis = three_mass(scenario.nominal.as_dict())
        self.model = self.axis.parametrize(self.names)
        self.theta = self.model.theta
        self.drift = np.array([*priors.DRIFT.values()])
        self.adaptations: Mapping[str, ByName] = {
            "forgetting": {"forgetting": FORGETTING},
            "modification": {"drift": self.drift},
            "slow forgetting": {"forgetting": 0.999},
            "slow modification": {"drift": self.drift / 16},  # time constants are 4 times longer
        }
        calm = scenario.override({"start": 1.0})
        pause = {"duration": 45.0, "excitation.pause": [list(PAUSE)]}
        self.scenarios = {
            "nominal": scenario,
            "calm": calm,
            "long": calm.override({"duration": 60.0}),
            "pause": calm.override(pause),
        }
        for name, (text, small) in FAULTS.items():
            self.scenarios[name] = fault = find_scenario(text)
            self.scenarios[f"small {name}"] = fault.override({"fault[0].factor": small})
            self.onset = fault.events()[0].index

    @cache  # noqa: B019
    def records(self, group: str) -> list[Any]:
        """Return all records of the scenario with the key `group` in `scenarios`."""
        number = self.sizes.get(group, self.sizes["others"])
        seeds = range(self.first, self.first + number)
        return records(self.scenarios[group], seeds, default_cache())

    @cached_property
    def reference(self) -> Array:
        """Torque of a separate simulation with nominal parameters [N m]."""
        return nominal_torque(self.scenario)

    def predict(self, torque: Array) -> tuple[Array, Array]:
        """Compute the predicted output ŷ and its gradient ψ for nominal parameters."""
        return predict(self.model, self.theta, torque, period=self.period)

    def steady(self, signal: Array) -> Array:
        """Return the last two periods of a signal, which contain no initial transient."""
        return signal[-2 * round(self.excitation.period / self.period) :]

    def gradient_power(self, torque: Array) -> Array:
        """Return the gradient covariance E ψψᵀ of equation (31) for a torque signal."""
        psi = self.steady(self.predict(torque)[1])
        return psi.T @ psi / len(psi)

    @cached_property
    def Q(self) -> Array:
        """Gradient covariance E ψψᵀ for the torque `reference`, as a matrix (p, p)."""
        return self.gradient_power(self.reference)

    def adaptation(self, method: Method) -> ByName:
        """Return the options of `Rpem` for a method, and convert time constants to a matrix Δ."""
        if isinstance(method, str):
            return self.adaptations[method]
        return {"drift": drift_for(method, self.Q, period=self.period)}

    def steady_P(self, method: Method) -> Array:
        """Return the steady-state matrix P of a method according to equation (29) or (30)."""
        return steady_P(self.Q, **self.adaptation(method))

    @cache  # noqa: B019
    def recipe(self, method: Method) -> Array:
        """Return the diagonal of the initial matrix P(0) according to section 5.2 of the paper."""
        return priors.nominal_P(
            self.axis, self.reference, identify=self.names, period=self.period,
            **self.adaptation(method),
        )  # fmt: skip

    def runs(self, method: Method) -> Runs:
        """Return the estimates of a method.

        The methods in `METHODS` use the experiment of the paper. The slower methods use the
        experiment of 60 s, and start at nominal parameter values.
        """
        return self.filtered("nominal" if method in METHODS else "long", method)

    @cache  # noqa: B019
    def filtered(self, group: str, method: Method, *, mu: float = 0.0, prior: float = 0.0) -> Runs:
        """Run the recursive prediction-error method (RPEM) on all records of a scenario.

        If the estimates start at nominal values, equation (29) or (30) determines P(0). Otherwise
        the method `recipe` determines P(0).

        Parameters
        ----------
        group : str
            Key of the scenario in `scenarios`.
        method : str or tuple of float
            Key of the method in `adaptations`, or one time constant per parameter [s].
        mu : float
            Regularisation parameter μ of equation (12).
        prior : float
            Relative standard deviation of the estimates after a reset of P at the fault onset. If
            `prior` is 0, P is not reset.
        """
        theta, P, nominal, start = [], [], self.theta, self.scenarios[group].start
        P0 = self.steady_P(method) if start == 1 else self.recipe(method)
        estimator = Rpem(
            self.axis, identify=self.names, theta0=start * nominal, P0=P0, period=self.period,
            regularization=mu, ceiling=np.inf, **self.adaptation(method),
        )  # fmt: skip
        for record in self.records(group):
            estimator.reset()
            parts = [signal.reshape(-1, STRIDE) for signal in signals(record)]
            for k, (u, y) in enumerate(zip(*parts, strict=True)):
                if prior and k * STRIDE == self.onset:
                    estimator.P = (prior * nominal / self.scenario.noise.speed) ** 2
                theta.append(estimator.run(u, y))
                P.append(np.diag(estimator.P))
        shape = len(self.records(group)), -1, len(self.names)
        return Runs(np.reshape(theta, shape) / nominal, np.reshape(P, shape))

    def identified(self, names: Sequence[str], start: float, record: int = 0) -> Identified:
        """Identify parameters off-line from a record of 60 s.

        The search starts at `start` times the nominal parameter values. The argument `record` is
        the index of the record.
        """
        theta = start * self.axis.parametrize(names).theta
        measured = signals(self.records("long")[record])
        return output_error(
            self.axis, *measured, identify=names, period=self.period, start=theta,
            max_evaluations=30,
        )  # fmt: skip

    @cached_property
    def offline(self) -> list[Identified]:
        """Results of the off-line identification of three parameters from each record of 60 s.

        Each search starts at 1.2 times the nominal parameter values.
        """
        return [self.identified(self.names, 1.2, i) for i in range(len(self.records("long")))]

    @cached_property
    def physical(self) -> Identified:
        """Off-line estimates of all axis parameters except r and k_T."""
        return self.identified(self.axis.parameters[1:-1], 1.2)


def signals(record: Record) -> Any:
    """Return the torque [N m] and the measured speed [rad/s] of a record."""
    return record.torque, record.speed
