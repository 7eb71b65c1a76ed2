"""The data for the claims: MuJoCo runs, and estimates on them.

No estimator is tuned on these seeds. Each result is computed on first use.
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
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.experiments.studies.definition import FIRST
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
ByName = Mapping[str, Any]
Method = str | tuple[float, ...]

FAULTS = {"k_T": ("kt_step-v1", 0.97), "1/J_a": ("ja_step-v1", 1.02), "f_m": ("fm_step-v1", 1.1)}
"""The step-fault scenario of each identified parameter, and a smaller factor on k_T, J_a or f_m:
small enough for linear theory, yet well above the noise."""
PAUSE = (10.0, 30.0)
"""Begin and end of the standstill in the scenario that shows windup [s]."""
FORGETTING = 0.995
METHODS = ("forgetting", "modification")
SIZES = {"nominal": 30, "long": 8, "calm": 30, "others": 16}
"""Number of runs of the paper's experiment, of its 60 s version, of its version that starts at the
true parameters, and of each standstill or fault."""
STRIDE = 20
"""Number of samples between two stored values of P."""


class Runs(NamedTuple):
    """Results of the recursive method on S records of N samples.

    Attributes
    ----------
    theta : ndarray (S, N, p)
        Estimates divided by nominal values.
    P : ndarray (S, N/STRIDE, p)
        Diagonal of P(t+1|t), every `STRIDE` samples.
    """

    theta: Array
    P: Array


class Evidence:
    """Simulated records, and estimates on them.

    Parameters
    ----------
    first : int
        Seed of the first run.
    sizes : mapping of str to int
        Numbers of runs, as in `SIZES`.

    Attributes
    ----------
    scenario : Scenario
        The paper's experiment.
    scenarios : dict of str to Scenario
        The paper's experiment (``"nominal"``), and variants that start at the true parameters: the
        same experiment (``"calm"``), over 60 s (``"long"``), with a standstill (``"pause"``), with
        a step fault (keyed by the identified parameter that changes), and with a small step (such
        as ``"small f_m"``).
    onset : int
        First sample after the fault; it is the same in all scenarios with a fault.
    model : Parametrization
        The nominal axis as a function of the identified parameters.
    theta : ndarray (p,)
        Nominal values of the identified parameters.
    adaptations : dict of str to dict
        Options of `Rpem` for each named method: the paper's λ, Δ of eq. (32), and slower versions
        of both. A method can also be a tuple of time constants [s], one per parameter.
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
            "slow modification": {"drift": self.drift / 16},  # 4 times slower
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
        """Return the records of a scenario in `scenarios`."""
        number = self.sizes.get(group, self.sizes["others"])
        seeds = range(self.first, self.first + number)
        return records(self.scenarios[group], seeds, default_cache())

    @cached_property
    def reference(self) -> Array:
        """Torque (8000,) [N m] of a separate run at nominal parameters."""
        return nominal_torque(self.scenario)

    def predict(self, torque: Array) -> tuple[Array, Array]:
        """Return ŷ (N,) and ψ (N, p) at nominal parameters for a torque (N,)."""
        return predict(self.model, self.theta, torque, period=self.period)

    def steady(self, signal: Array) -> Array:
        """Return the last two periods of a signal (N, …), after all transients."""
        return signal[-2 * round(self.excitation.period / self.period) :]

    def gradient_power(self, torque: Array) -> Array:
        """Return E ψψᵀ (p, p) for a torque (N,), eq. (31)."""
        psi = self.steady(self.predict(torque)[1])
        return psi.T @ psi / len(psi)

    @cached_property
    def Q(self) -> Array:
        """E ψψᵀ (p, p) for the reference torque."""
        return self.gradient_power(self.reference)

    def adaptation(self, method: Method) -> ByName:
        """Return the options of `Rpem` for a method; time constants are converted to Δ."""
        if isinstance(method, str):
            return self.adaptations[method]
        return {"drift": drift_for(method, self.Q, period=self.period)}

    def steady_P(self, method: Method) -> Array:
        """Return the steady-state P (p, p) of a method by eq. (29) or (30)."""
        return steady_P(self.Q, **self.adaptation(method))

    @cache  # noqa: B019
    def recipe(self, method: Method) -> Array:
        """Return the diagonal of P(0) (p,), computed as section 5.2 of the paper describes."""
        return priors.nominal_P(
            self.axis, self.reference, identify=self.names, period=self.period,
            **self.adaptation(method),
        )  # fmt: skip

    def runs(self, method: Method) -> Runs:
        """Return the runs of a method: slow methods run for 60 s from nominal values."""
        return self.filtered("nominal" if method in METHODS else "long", method)

    @cache  # noqa: B019
    def filtered(self, group: str, method: Method, *, mu: float = 0.0, prior: float = 0.0) -> Runs:
        """Run the recursive prediction-error method on each record of a group.

        P(0) follows eq. (29) or (30) if the run starts at nominal values; otherwise it is computed
        by `recipe`.

        Parameters
        ----------
        group : str
            A key of `scenarios`.
        method : str or tuple of float
            A key of `adaptations`, or time constants [s].
        mu : float
            Regularisation μ of eq. (12).
        prior : float
            Relative standard deviation of the estimates to which P is reset at the onset of the
            fault; 0 for no reset.
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
        """Identify parameters off-line from a 60 s run; `start` is the start value / nominal."""
        theta = start * self.axis.parametrize(names).theta
        measured = signals(self.records("long")[record])
        return output_error(
            self.axis, *measured, identify=names, period=self.period, start=theta,
            max_evaluations=30,
        )  # fmt: skip

    @cached_property
    def offline(self) -> list[Identified]:
        """The three parameters, identified on each 60 s record, starting at 1.2 × nominal."""
        return [self.identified(self.names, 1.2, i) for i in range(len(self.records("long")))]

    @cached_property
    def physical(self) -> Identified:
        """Off-line estimates of all parameters except r and k_T, which sets the scale."""
        return self.identified(self.axis.parameters[1:-1], 1.2)


def signals(record: Record) -> Any:
    """Return the torque (N,) [N m] and the measured speed (N,) [rad/s] of a record."""
    return record.torque, record.speed
