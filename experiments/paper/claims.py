"""The claims of the paper as data: to add one, add its entry."""

from __future__ import annotations

from typing import Any

from flexaxis.experiments.paper import filter_measures as f
from flexaxis.experiments.paper import model_measures as m
from flexaxis.experiments.paper.claim import Check, above, below, half_of_P, spread, within
from flexaxis.experiments.paper.experiments import HIGH_ORDER, LOW_ORDER, times

PEAKS = (95.0, 125.0, 185.0)
"""Peaks of the torque spectrum that the paper reports [rad/s]."""


def _three_peaks(peaks: Any) -> bool:
    found = list(peaks.values())
    return len(found) == len(PEAKS) and all(
        abs(one - two) <= 8 for one, two in zip(found, PEAKS, strict=True)
    )


CHECKS = (
    Check(
        "model-predicts-the-plant", "section 2, eq. (1)–(4); section 3.2",
        "At the true parameters the sampled model gives the motor speed of the MuJoCo axis",
        "relative rms error ≤ 3e-4", m.prediction_error, within(0, 3e-4),
    ),
    Check(
        "faults-come-on-time", "section 2, eq. (1)–(4)",
        "A step of a parameter acts on the motion from the very sample on at which the truth steps",
        "|samples late| ≤ 0.25 for a step of each parameter", m.samples_late, within(-0.25, 0.25),
    ),
    Check(
        "derivative-for-friction", "section 3.2, eq. (18), (20), (24)",
        "The derivative of A for f_m has the one entry −1/J_m, those of B and C are zero",
        "the entry (3,3) over −1/J_m is 1, all others are 0",
        m.friction_derivative, lambda d: abs(d["entry"] - 1) <= 1e-9 and d["others"] <= 1e-9,
    ),
    Check(
        "gradient-is-the-derivative", "section 3.2, eq. (16)–(23)",
        "ψ of the extended system is the derivative of ŷ, for each of the twelve parameters",
        "relative error ≤ 1e-5 for every parameter", m.gradient_error, within(0, 1e-5, least=12),
    ),
    Check(
        "peaks-of-the-torque", "section 4, Fig. 3",
        "The spectrum of the torque in closed loop has peaks around 95, 125 and 185 rad/s",
        "three peaks, each within 8 rad/s of 95, 125 and 185 rad/s", m.torque_peaks, _three_peaks,
    ),
    Check(
        "little-torque-below-70", "section 4, Fig. 3",
        "The energy of the torque is low below 70 rad/s",
        "< 5 % of the energy", m.low_energy, below(5),
    ),
    Check(
        "order-of-the-gradients", "section 5.1, Fig. 5, eq. (28)",
        "The variance of ψ is highest for f_m, less for 1/J_a and lowest for k_T",
        "f_m over 1/J_a over k_T", m.gradient_power, lambda p: p["f_m"] > p["1/J_a"] > p["k_T"],
    ),
    Check(
        "spectrum-gives-the-variance", "section 3.3, eq. (28), (31)",
        "The integral of |G_θ|² over the spectrum of the torque is the mean of ψ² over time",
        "ratio within 1 % of one in every run", m.power_over_spectrum, within(0.99, 1.01),
    ),
    Check(
        "offline-finds-the-parameters", "section 4",
        "Off-line output error over 60 s, started 20 % too high, finds the parameters",
        "≤ 0.3 % of each parameter in every run", m.offline_error, within(0, 0.3),
    ),
    Check(
        "offline-within-its-deviations", "section 4",
        "Each parameter identified off line lies within three of its standard deviations",
        "≤ 3 of its own standard deviations in every run", m.offline_deviations, within(0, 3),
    ),
    Check(
        "offline-deviations-are-right", "section 4",
        "The standard deviations of off-line identification are those that are seen",
        "rms error between 0.5 and 1.5 of the standard deviation claimed",
        m.offline_rms, within(0.5, 1.5),
    ),
    Check(
        "offline-near-starts-agree", "section 4",
        "Off-line identification finds the same from 1.2 and from 1.5 times nominal",
        "no warning, the same estimates to 1e-4",
        m.near_starts, lambda n: n["difference"] <= 1e-4 and n["warnings"] == 0,
    ),
    Check(
        "offline-reports-local-minima", "section 4",
        "Started too far off, identification ends in a local minimum and says so",
        "a warning for 0.5, 0.7 and 2 times nominal", m.far_starts, above(0.5),
    ),
    Check(
        "offline-reports-the-free-scale", "section 4",
        "Torque and speed leave the scale of all parameters open: one of k_T and J_m must be known",
        "condition > 1e10, and the warning names every parameter",
        m.free_scale, lambda s: s["condition"] > 1e10 and s["unnamed"] == 0,
    ),
    Check(
        "identified-model-fits", "section 4, Fig. 4",
        "The physical model identified from the data has the frequency response of the axis",
        "within 0.25 dB of the truth over 40–188 rad/s", m.physical_error, within(0, 0.25),
    ),
    Check(
        "high-order-arx-agrees", "section 4, Fig. 4",
        "A very high order ARX model agrees with the physical one",
        "within 1 dB of the truth over 40–188 rad/s from order 30 on",
        lambda e: m.arx_error(e, 30, HIGH_ORDER), within(0, 1),
    ),
    Check(
        "low-order-arx-does-not", "section 4, Fig. 4",
        "The order of the ARX model has to be very high: white output noise biases a low one",
        "more than 3 dB off at order 10", lambda e: m.arx_error(e, LOW_ORDER), above(3),
    ),
    Check(
        "forgetting-converges", "section 5.3, Fig. 6",
        "With forgetting all estimates converge to their nominal values",
        "median of the final error < 0.5 % of nominal", f.middle_error, below(0.5),
    ),
    Check(
        "every-run-converges", "section 5.3, Fig. 6",
        "With forgetting every single run converges",
        "final error < 1.5 % of nominal in every run", f.largest_error, below(1.5),
    ),
    Check(
        "torque-constant-is-fastest", "section 5.3, Fig. 6",
        "With forgetting the estimate of k_T converges at a somewhat higher rate",
        "t63 [s] of k_T is the shortest",
        lambda e: times(e.data, e.convergence.runs["forgetting"], 0.37),
        lambda t63: t63["k_T"] < min(t63["1/J_a"], t63["f_m"]),
    ),
    Check(
        "inertia-and-friction-alike", "section 5.3, Fig. 6",
        "With forgetting the rate is about the same for J_a and f_m",
        "t90 [s] of f_m over that of 1/J_a within 0.6 and 1.7",
        lambda e: times(e.data, e.convergence.runs["forgetting"], 0.10),
        lambda t90: 0.6 <= t90["f_m"] / t90["1/J_a"] <= 1.7,
    ),
    Check(
        "P-differs-with-forgetting", "section 5.3, Fig. 7",
        "With forgetting the diagonal elements of P differ much in magnitude",
        "largest over smallest > 20",
        lambda e: f.magnitudes(e, "forgetting"), lambda P: spread(P) > 20,
    ),
    Check(
        "P-is-even-with-modification", "section 5.3, Fig. 9, eq. (32)",
        "With Δ = 1e-8 diag(5, 50, 500) the diagonal elements of P have the same magnitude",
        "largest over smallest < 3",
        lambda e: f.magnitudes(e, "modification"), lambda P: spread(P) < 3,
    ),
    Check(
        "recipe-gives-the-working-P", "section 5.2",
        "The update of P with ψ at nominal gives the P at which the filter then works",
        "P(0) over the mean of diag P in the second half within 15 % of one",
        f.recipe_over_mean, within(0.85, 1.15),
    ),
    Check(
        "torque-constant-is-slower", "section 5.3, Fig. 8",
        "With covariance modification the convergence rate of k_T is lower",
        "t63 [s] of k_T at least twice that with forgetting",
        f.first_63_percent, lambda t63: t63["modification"] > 2 * t63["forgetting"],
    ),
    Check(
        "torque-constant-is-quieter", "section 5.3, Fig. 8",
        "With covariance modification the variance of k_T is lower",
        "standard deviation [%] of k_T below that with forgetting",
        lambda e: f.std_of(e, "k_T"), lambda std: std["modification"] < std["forgetting"],
    ),
    Check(
        "friction-is-noisier", "section 5.3, Fig. 8",
        "With covariance modification the variance of f_m is much higher",
        "standard deviation [%] of f_m over 3 times that with forgetting",
        lambda e: f.std_of(e, "f_m"), lambda std: std["modification"] > 3 * std["forgetting"],
    ),
    Check(
        "steady-P-with-slow-forgetting", "section 5.2, eq. (29)",
        "For λ close to one P is (1−λ) Q⁻¹", "λ = 0.999: P over theory within 5 % of one",
        lambda e: f.over_theory(e, "slow forgetting"), within(0.95, 1.05),
    ),
    Check(
        "steady-P-with-forgetting", "section 5.2, eq. (29)",
        "At the λ of the paper P is near (1−λ) Q⁻¹", "λ = 0.995: P over theory within 25 % of one",
        lambda e: f.over_theory(e, "forgetting"), within(0.75, 1.25),
    ),
    Check(
        "steady-P-with-slow-modification", "section 5.2, eq. (30)",
        "For a small Δ P solves P Q P = Δ", "Δ/16: P over theory within 15 % of one",
        lambda e: f.over_theory(e, "slow modification"), within(0.85, 1.15),
    ),
    Check(
        "steady-P-with-modification", "section 5.2, eq. (30), (32)",
        "At the Δ of the paper P nearly solves P Q P = Δ",
        "Δ of (32): P over theory within 30 % of one",
        lambda e: f.over_theory(e, "modification"), within(0.7, 1.3),
    ),
    Check(
        "variance-with-forgetting", "section 5.2, with eq. (29)",
        "With forgetting the variance of an estimate is σ² P/2",
        "standard deviation over √(σ²P/2) within 30 % of one, the mean nearer to it than to √(σ²P)",
        lambda e: f.deviation_over_claim(e, "forgetting"), half_of_P(0.3),
    ),
    Check(
        "variance-with-modification", "section 5.2, with eq. (30)",
        "With covariance modification, too, the variance of an estimate is σ² P/2",
        "standard deviation over √(σ²P/2) within 40 % of one, the mean nearer to it than to √(σ²P)",
        lambda e: f.deviation_over_claim(e, "modification"), half_of_P(0.4),
    ),
    Check(
        "regularisation-bounds-forgetting", "section 3.1, eq. (9), (12)",
        "With forgetting and regularisation P comes to (1−λ)/μ without excitation, and no higher",
        "largest P in a standstill of 20 s, over (1−λ)/μ: ≤ 1, and within 2 % of it",
        f.peak_over_bound, within(0.98, 1 + 1e-9, least=3),
    ),
    Check(
        "regularisation-bounds-modification", "section 3.1, eq. (10), (12)",
        "With covariance modification, regularisation keeps P_ii below √(Δ_ii/μ)",
        "largest P_ii in a standstill of 20 s, over √(Δ_ii/μ): ≤ 1; for the largest μ ≥ 0.98",
        f.peaks_over_bounds,  # a small μ takes longer than the standstill
        lambda p: within(0, 1 + 1e-9, least=3)(p) and [*p.values()][-1] >= 0.98,
    ),
    Check(
        "forgetting-winds-up", "section 3.1; section 5.3, last paragraph",
        "With forgetting and without regularisation P grows without bound at standstill",
        "P grows more than 1e6-fold in 20 s", f.growth, above(1e6),
    ),
    Check(
        "drift-from-time-constants", "section 5.3, choice of Δ left open",
        "Δ_ii = 1/(τ_i² Q_ii) gives each estimate the time constant that is wanted",
        "t63 over wanted within 1/1.4 … 1.4 from 1.2 s on", f.time_constants, within(1 / 1.4, 1.4),
    ),
    Check(
        "time-constants-one-by-one", "section 5.3, choice of Δ left open",
        "The time constants of the parameters can be chosen one by one",
        "t63 over wanted within 1/1.4 … 1.4 of 2.4, 1.2 and 0.6 s", f.apart, within(1 / 1.4, 1.4),
    ),
    Check(
        "variance-of-the-choice", "section 5.3, choice of Δ left open",
        "The variance that a time constant costs is predicted by σ² P/2 with P of eq. (30)",
        "standard deviation over predicted within 20 % of one",
        f.std_of_the_choice, within(0.8, 1.2),
    ),
    Check(
        "regularisation-stops-the-burst", "section 5.3, regularisation left open",
        "μ = 1 stops the burst of the estimates when the excitation returns after a standstill",
        "burst [%] of θ̂ over 100 without, below 20 with",
        f.bursts, lambda burst: burst["μ = 0"] > 100 and burst["μ = 1"] < 20,
    ),
    Check(
        "regularisation-costs-little", "section 5.3, regularisation left open",
        "μ = 1 makes the estimates hardly slower where the axis moves",
        "lag after a fault over that with μ = 0, ≤ 1.15", f.prices, within(0, 1.15),
    ),
    Check(
        "reset-shortens-the-lag", "section 5.2, change detection left open",
        "Resetting P to a prior of 3 % at a known change makes the estimates follow faster",
        "lag without over with reset ≥ 1.5 for each",
        lambda e: f.lag_over(e, None), lambda gain: min(gain.values()) >= 1.5,
    ),
    Check(
        "reset-can-be-too-large", "section 5.2, change detection left open",
        "A reset to a prior of 100 % throws estimates off before they settle",
        "lag with 100 % over that with 3 %: > 3 for one",
        lambda e: f.lag_over(e, 1.0), lambda loss: max(loss.values()) > 3,
    ),
)  # fmt: skip
"""All checks, in the order of the paper."""
