"""Compute the measures that test the paper's claims from simulations and estimates."""

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import approx_fprime
from scipy.signal import find_peaks, freqz

from flexaxis.estimators.offline.frequency import (
    fit_arx,
    frequency_response,
    information,
    line_spectrum,
)
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.priors import estimate_covariance
from flexaxis.experiments.paper.evidence import (
    FORGETTING,
    METHODS,
    PAUSE,
    Array,
    ByName,
    Evidence,
    Method,
    Runs,
    signals,
)
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.experiments.scoring.scores import lag, rms, settling
from flexaxis.sim.simulate import simulate

PHYSICAL = "physical model, identified"
BAND = (40.0, 188.0)
"""Frequency band of the excitation, in which Figure 4 compares the models [rad/s]."""
ORDERS = (10, 30, 40)
"""Orders of the ARX models."""
SLOW = (3 * (1.2,), 3 * (2.4,))
"""Time constants of two slow designs [s], which are longer than the plant time constants."""
MU = (0.1, 1.0, 10.0)
"""Values of the regularisation parameter μ for which P(0) is below the bound of P."""
WINDOW = 1000
"""Number of samples that the measures evaluate after a fault or a standstill."""
LAST = 2000
"""Number of samples at the end of a run from which standard deviations are computed."""


def worst(ratios: ArrayLike) -> Array:
    """For each column, return the ratio that differs most from 1, inverted if it is below 1."""
    return np.exp(np.abs(np.log(ratios)).max(axis=0))


def decibels(response: Any) -> Any:
    """Return the magnitude of a frequency response in decibels."""
    return 20 * np.log10(np.abs(response))


def std(runs: Runs) -> Array:
    """Return the relative standard deviation of each parameter estimate.

    The function computes the variance across all runs at each time, and averages this variance over
    the last 10 s. The variance of a single run over time would be too small for slow estimates,
    such as k_T with covariance modification.
    """
    return np.sqrt(np.var(runs.theta[:, -LAST:], axis=0, ddof=1).mean(axis=0))


class Measures(Evidence):
    """Measures that test the claims of the paper; each public method computes one measure.

    If a measure has one value for each identified parameter, the method returns an array (p,).
    """

    def prediction_error(self) -> Any:
        """Return the rms prediction error for true parameters, divided by the rms motor speed."""
        record = self.records("nominal")[0]
        error = self.predict(record.torque)[0] - record.true_speed
        return np.std(error) / np.std(record.true_speed)

    def samples_late(self) -> ByName:
        """For each parameter, return the delay from its step to the effect on the speed [samples].

        The method compares each run with a second run, in which the step occurs one sample later.
        The effect begins at the first sample at which the two runs differ. The delay is 0 if the
        two runs differ at the first sample after the onset.
        """
        result = {}
        for name in self.names:
            scenario, (record, *_) = self.scenarios[name], self.records(name)
            later = {"fault[0].at": (self.onset + 1) * self.period}
            (other,) = simulate(scenario.override(later, inherit=True), [self.first])
            differ = np.flatnonzero(record.true_speed != other.true_speed)
            result[name] = differ[0] - self.onset - 1
        return result

    def friction_derivative(self) -> ByName:
        """Return the non-zero entries of the matrix ∂[A B; C 0]/∂f_m, divided by −1/J_m."""
        _, slope = self.axis.parametrize(["f_m"]).blocks([self.scenario.nominal.f_m])
        return {f"({i + 1},{j + 1})": -slope[i, j] * self.scenario.nominal.J_m
                for i, j in np.argwhere(slope)}  # fmt: skip

    def gradient_error(self) -> ByName:
        """Return the relative error of each component of the gradient ψ, keyed by parameter.

        The reference for the gradient is a finite difference of the predicted output ŷ.
        """
        model = self.axis.parametrize(self.axis.parameters)
        torque = self.records("nominal")[0].torque[:WINDOW]
        both = partial(predict, model, u=torque, period=self.period)
        psi = both(model.theta)[1]
        slope = approx_fprime(model.theta, lambda theta: both(theta)[0], 3e-7 * model.theta)
        error = np.linalg.norm(slope - psi, axis=0) / np.linalg.norm(psi, axis=0)
        return dict(zip(model.names, error, strict=True))

    def torque_lines(self) -> tuple[Array, Array]:
        """Return the frequencies [rad/s] and amplitudes [N m] of the torque spectrum lines."""
        torque = self.steady(self.records("nominal")[0].torque)
        omega, power = line_spectrum(torque, period=self.period)
        last = round(2 * self.excitation.high * self.excitation.period)
        # the DFT of two periods is zero between the lines
        lines = slice(2, last + 1, 2)
        return omega[lines], np.sqrt(2 * power[lines])

    def torque_peaks(self) -> ByName:
        """Return the frequencies of all peaks in the torque spectrum [rad/s].

        The first or last frequency is also a peak if its amplitude exceeds the neighbouring
        amplitude.
        """
        omega, amplitude = self.torque_lines()
        peaks, _ = find_peaks(np.r_[0, amplitude, 0])
        return {f"peak {i}": w for i, w in enumerate(omega[peaks - 1], 1)}

    def low_energy(self) -> Any:
        """Return the fraction of the torque energy that lies below 70 rad/s [%]."""
        omega, amplitude = self.torque_lines()
        return 100 * np.sum(amplitude[omega < 70] ** 2) / np.sum(amplitude**2)

    def gradient_variances(self) -> Array:
        """Return the gradient variance E ψ² for each parameter, as an array (p,)."""
        return np.diag(self.Q)

    def power_over_spectrum(self) -> Array:
        """Compare the gradient power in the time domain with its value in the frequency domain.

        The gradient power is the mean of ψ² in the time domain, and the integral of |G_θ|² Φ_u in
        the frequency domain. For each parameter, the method returns the ratio of the two values in
        the run in which they differ most.
        """
        ratios = []
        for record in self.records("nominal"):
            power = self.gradient_power(record.torque)
            lines = line_spectrum(self.steady(record.torque), period=self.period)
            spectral = information(self.model, self.theta, *lines, period=self.period)
            ratios.append(np.diag(power / spectral))
        return worst(ratios)

    def offline_error(self) -> Array:
        """For each parameter, return the largest off-line error of all runs [% of nominal]."""
        return 100 * np.max([np.abs(run.theta / self.theta - 1) for run in self.offline], axis=0)

    def offline_deviations(self) -> Array:
        """Return the absolute off-line errors, divided by their reported standard deviations."""
        return np.abs([(r.theta - self.theta) / r.standard_deviations for r in self.offline])

    def worst_deviations(self) -> Array:
        """For each parameter, return the largest normalised off-line error of all runs."""
        return self.offline_deviations().max(axis=0)

    def rms_deviation(self) -> Any:
        """Return the root mean square of all normalised off-line estimation errors."""
        return rms(self.offline_deviations().ravel())

    def near_starts(self) -> ByName:
        """Compare two off-line estimates, and return their largest relative difference.

        The two searches start at 1.2 and 1.5 times the nominal parameters. The entry ``warnings``
        is the total number of warnings from both searches.
        """
        near, other = self.offline[0], self.identified(self.names, 1.5)
        difference = np.abs(near.theta / other.theta - 1).max()
        return {"difference": difference, "warnings": len((*near.warnings, *other.warnings))}

    def far_starts(self) -> ByName:
        """Return the residual correlation after each search that starts far from nominal values.

        If a search does not warn of a local minimum, its value in the result is 0 instead.
        """
        runs = {f"{start:g}×": self.identified(self.names, start) for start in (0.5, 0.7, 2.0)}
        return {
            n: r.correlation * ("local minimum" in " ".join(r.warnings)) for n, r in runs.items()
        }

    def free_scale(self) -> ByName:
        """Return the condition number of the off-line identification of all parameters except r.

        The entry ``unnamed`` is the number of parameters that no warning mentions.
        """
        run = self.identified(self.axis.parameters[:-1], 1.0)  # all parameters except r, the last
        warned = " ".join(run.warnings)
        return {"condition": run.condition, "unnamed": sum(n not in warned for n in run.names)}

    def responses(self, omega: Array) -> dict[str, Any]:
        """Return the frequency responses of the axis and all models in Figure 4, keyed by name."""
        u, y = signals(self.records("long")[0])
        result = {}
        for n in ORDERS:
            a, b = fit_arx(u, y, order=n)
            result[f"ARX, order {n}"] = freqz(b, a, worN=omega * self.period)[1]
        for name, known in (("axis", self.model), (PHYSICAL, self.physical)):
            model = self.axis.parametrize(known.names)
            result[name], _ = frequency_response(model, known.theta, omega, period=self.period)
        return result

    def magnitude_error(self, *names: str) -> ByName:
        """Return the largest magnitude error of each model in the excited frequency band [dB]."""
        result = self.responses(np.linspace(*BAND, 400))
        return {name: np.abs(decibels(result[name] / result["axis"])).max() for name in names}

    def final_error(self, percentile: float) -> Array:
        """For each parameter, return a percentile of the final error with forgetting [%].

        The percentile is computed over all runs.
        """
        errors = np.abs(self.runs("forgetting").theta[:, -1] - 1)
        return 100 * np.percentile(errors, percentile, axis=0)

    def settled(self, errors: Iterable[Array], level: float) -> Array:
        """Return the time after which the median error of each parameter remains below a limit [s].

        Parameters
        ----------
        errors : iterable of ndarray (S, n)
            Estimation errors of each parameter in S runs at n samples.
        level : float
            Upper limit for the absolute value of the median error.
        """
        medians = [np.median(error, axis=0) for error in errors]
        return np.array([settling(error, level, self.period) for error in medians], float)

    def times(self, method: str, level: float) -> Array:
        """Return the settling time of the median error of each parameter [s].

        After the settling time, the median error is below the fraction `level` of the initial
        error.
        """
        errors = (self.runs(method).theta - 1) / (self.scenario.start - 1)
        return self.settled(errors.transpose(2, 0, 1), level)

    def mean_P(self, method: str) -> Array:
        """Return the diagonal (p,) of P, averaged over the second halves of all runs."""
        P = self.runs(method).P
        return P[:, P.shape[1] // 2 :].mean(axis=(0, 1))

    def growth_of_P(self) -> Array:
        """Return the mean diagonal of P, divided by its value for a smaller covariance Δ.

        The larger covariance is the Δ of equation (32), and the smaller covariance is Δ/16.
        """
        return self.mean_P("modification") / self.mean_P("slow modification")

    def recipe_over_mean(self) -> Array:
        """Return the diagonal of P(0) divided by the mean diagonal of P, for the worst method."""
        return worst([self.recipe(method) / self.mean_P(method) for method in METHODS])

    def times_of_k_T(self) -> ByName:
        """Return the time until the k_T error falls below 37 % of its initial value [s]."""
        return {method: self.times(method, 0.37)[0] for method in METHODS}

    def stds(self, name: str) -> ByName:
        """Return the relative standard deviation of a parameter estimate [%], keyed by method."""
        return {m: 100 * std(self.runs(m))[self.names.index(name)] for m in METHODS}

    def over_theory(self, method: str) -> Array:
        """Return the mean diagonal of P, divided by the theoretical diagonal of P."""
        return self.mean_P(method) / np.diag(self.steady_P(method))

    def claimed(self, P: Array) -> Array:
        """Return the theoretical standard deviations √(σ² P/2), divided by nominal values."""
        return np.sqrt(np.diag(estimate_covariance(P, self.scenario.noise.speed**2))) / self.theta

    def std_over_claim(self, method: str) -> Array:
        """Return the measured standard deviations, divided by the theoretical values √(σ² P/2)."""
        return std(self.runs(method)) / self.claimed(np.diag(self.mean_P(method)))

    def peaks_over_bounds(self, method: str) -> ByName:
        """Return the largest ratio of P to its bound in all runs with a standstill, keyed by μ.

        The bound of P_ii is (1−λ)/μ for forgetting, and √(Δ_ii/μ) for covariance modification.
        """
        result = {}
        for mu in MU:
            bound = (1 - FORGETTING) / mu if method == "forgetting" else np.sqrt(self.drift / mu)
            result[f"μ = {mu:g}"] = np.max(self.filtered("pause", method, mu=mu).P / bound)
        return result

    def growth(self) -> Any:
        """Return the factor by which P grows during a standstill if P is not regularised."""
        P = self.filtered("pause", "forgetting").P
        return P.max() / P[:, 0].max()

    def bursts(self) -> ByName:
        """Return the median over all runs of the largest relative error after a standstill [%]."""
        restart, result = round(PAUSE[1] / self.period), {}
        for mu in (0.0, 1.0):
            theta = self.filtered("pause", "forgetting", mu=mu).theta[:, restart:][:, :WINDOW]
            result[f"μ = {mu:g}"] = 100 * np.median(np.abs(theta - 1).max(axis=(1, 2)))
        return result

    def steps(self, kind: str, method: Method, **options: float) -> Iterator[Array]:
        """For each parameter, yield the estimation errors (S, n) after a step of this parameter.

        The estimation errors are divided by the step size.
        """
        for i, name in enumerate(self.names):
            parameters = self.records(kind + name)[0].true_parameters[self.onset - 1 :]
            before, *after = true_theta(self.names, parameters)[:, i] / self.theta[i]
            theta = self.filtered(kind + name, method, **options).theta[:, self.onset :, i]
            yield (theta - after) / abs(after[0] - before)

    def lags(self, method: str, **options: float) -> Array:
        """Return the mean lag of each parameter estimate after a step of the parameter [s]."""
        errors = self.steps("", method, **options)
        return np.array([lag(error[:, :WINDOW].T, self.period).mean() for error in errors])

    def lag_ratio(self, prior: float, base: float) -> Array:
        """Return the ratio of the estimation lags for two resets of P at the fault onset.

        The lags after a reset to `prior` are divided by the lags after a reset to `base`. If
        `prior` or `base` is 0, P is not reset.
        """
        return self.lags("forgetting", prior=prior) / self.lags("forgetting", prior=base)

    def prices(self) -> ByName:
        """Return the lag with regularisation (μ = 1) divided by the lag without it (μ = 0).

        The result contains the largest lag ratio of all parameters, keyed by method.
        """
        return {method: np.max(self.lags(method, mu=1.0) / self.lags(method)) for method in METHODS}

    def t63_over(self, *targets: float) -> Array:
        """Return the settling times after a small step, divided by the desired time constants.

        The matrix Δ is designed for the desired time constants `targets` [s]. After the settling
        time, the error is below 37 % of the step size.
        """
        return self.settled(self.steps("small ", targets), 0.37) / targets

    def slow_t63(self) -> Array:
        """Return the worst ratio of settling time to desired time constant for slow designs."""
        return worst([self.t63_over(*targets) for targets in SLOW])

    def slow_std(self) -> Array:
        """Return the mean ratio of measured to predicted standard deviation for slow designs."""
        return np.mean(
            [
                std(self.filtered("calm", targets)) / self.claimed(self.steady_P(targets))
                for targets in SLOW
            ],
            axis=0,
        )
