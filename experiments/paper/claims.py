"""The claims of the paper as data: to add one, add its entry."""

from typing import Any

import numpy as np

from flexaxis.experiments.paper.claim import Check, above, below, half_of_P, within
from flexaxis.experiments.paper.measures import PHYSICAL, Measures, worst

SLOW = [3 * (1.2,), 3 * (2.4,)]
"""Time constants of the parameters that exceed the memory of the plant [s]."""
PEAKS = (95.0, 125.0, 185.0)
"""Peaks of the torque spectrum that the paper reports [rad/s]."""


def _three_peaks(peaks: Any) -> bool:
    return len(peaks) == len(PEAKS) and np.allclose(peaks, PEAKS, rtol=0, atol=8)


CHECKS = (
    Check(
        "model-predicts-the-plant", "section 2, eq. (1)–(4); section 3.2",
        "At the true parameters the sampled model gives the motor speed of the MuJoCo axis",
        "relative rms error ≤ 3e-4", Measures.prediction_error, within(0, 3e-4),
    ),
    Check(
        "faults-come-on-time", "section 2, eq. (1)–(4)",
        "A step of a parameter acts on the motion from the very sample on at which the truth steps",
        "0 samples late, for a step of each parameter", Measures.samples_late, within(0, 0),
    ),
    Check(
        "derivative-for-friction", "section 3.2, eq. (18), (20), (24)",
        "The derivative of A for f_m has the one entry −1/J_m, those of B and C are zero",
        "no entry but (3,3), which is 1 times −1/J_m",
        Measures.friction_derivative,
        lambda d: [*d.index] == ["(3,3)"] and abs(d.iloc[0] - 1) < 1e-9,
    ),
    Check(
        "gradient-is-the-derivative", "section 3.2, eq. (16)–(23)",
        "ψ of the extended system is the derivative of ŷ, for each of the twelve parameters",
        "relative error ≤ 1e-5 for every parameter",
        Measures.gradient_error, within(0, 1e-5, least=12),
    ),
    Check(
        "peaks-of-the-torque", "section 4, Fig. 3",
        "The spectrum of the torque in closed loop has peaks around 95, 125 and 185 rad/s",
        "three peaks, each within 8 rad/s of 95, 125 and 185 rad/s",
        Measures.torque_peaks, _three_peaks,
    ),
    Check(
        "little-torque-below-70", "section 4, Fig. 3",
        "The energy of the torque is low below 70 rad/s",
        "≤ 5 % of the energy", Measures.low_energy, below(5),
    ),
    Check(
        "order-of-the-gradients", "section 5.1, Fig. 5, eq. (28)",
        "The variance of ψ is highest for f_m, less for 1/J_a and lowest for k_T",
        "f_m over 1/J_a over k_T",
        lambda e: np.diag(e.Q), lambda p: p["f_m"] > p["1/J_a"] > p["k_T"],
    ),
    Check(
        "spectrum-gives-the-variance", "section 3.3, eq. (28), (31)",
        "The integral of |G_θ|² over the spectrum of the torque is the mean of ψ² over time",
        "one over the other ≤ 1.01 in every run", Measures.power_over_spectrum, below(1.01),
    ),
    Check(
        "offline-finds-the-parameters", "section 4",
        "Off-line output error over 60 s, started 20 % too high, finds the parameters",
        "≤ 0.3 % of each parameter in every run", Measures.offline_error, within(0, 0.3),
    ),
    Check(
        "offline-within-its-deviations", "section 4",
        "Each parameter identified off line lies within three of its standard deviations",
        "≤ 3 of its own standard deviations in every run",
        lambda e: e.offline_deviations().max(axis=0), within(0, 3),
    ),
    Check(
        "offline-deviations-are-right", "section 4",
        "The standard deviations of off-line identification are those that are seen",
        "rms error between 0.5 and 1.5 of the standard deviation claimed",
        lambda e: float(np.sqrt(np.mean(e.offline_deviations() ** 2))), within(0.5, 1.5),
    ),
    Check(
        "offline-near-starts-agree", "section 4",
        "Off-line identification finds the same from 1.2 and from 1.5 times nominal",
        "no warning, the same estimates to 1e-4",
        Measures.near_starts, lambda n: n["difference"] <= 1e-4 and n["warnings"] == 0,
    ),
    Check(
        "offline-reports-local-minima", "section 4",
        "Started too far off, identification ends in a local minimum and says so",
        "a warning for 0.5, 0.7 and 2 times nominal", Measures.far_starts, above(0.5),
    ),
    Check(
        "offline-reports-the-free-scale", "section 4",
        "Torque and speed leave the scale of all parameters open: one of k_T and J_m must be known",
        "condition > 1e10, and the warning names every parameter",
        Measures.free_scale, lambda s: s["condition"] > 1e10 and s["unnamed"] == 0,
    ),
    Check(
        "identified-model-fits", "section 4, Fig. 4",
        "The physical model identified from the data has the frequency response of the axis",
        "within 0.25 dB of the truth over 40–188 rad/s",
        lambda e: e.magnitude_error(PHYSICAL), within(0, 0.25),
    ),
    Check(
        "high-order-arx-agrees", "section 4, Fig. 4",
        "A very high order ARX model agrees with the physical one",
        "within 1 dB of the truth over 40–188 rad/s from order 30 on",
        lambda e: e.magnitude_error("ARX, order 30", "ARX, order 40"), within(0, 1),
    ),
    Check(
        "low-order-arx-does-not", "section 4, Fig. 4",
        "The order of the ARX model has to be very high: white output noise biases a low one",
        "more than 3 dB off at order 10", lambda e: e.magnitude_error("ARX, order 10"), above(3),
    ),
    Check(
        "forgetting-converges", "section 5.3, Fig. 6",
        "With forgetting all estimates converge to their nominal values",
        "median of the final error ≤ 0.5 % of nominal",
        lambda e: np.median(e.final_error(), axis=0), below(0.5),
    ),
    Check(
        "every-run-converges", "section 5.3, Fig. 6",
        "With forgetting every single run converges",
        "final error ≤ 1.5 % of nominal in every run",
        lambda e: e.final_error().max(axis=0), below(1.5),
    ),
    Check(
        "torque-constant-is-fastest", "section 5.3, Fig. 6",
        "With forgetting the estimate of k_T converges at a somewhat higher rate",
        "t63 [s] of k_T is the shortest",
        lambda e: e.times("forgetting", 0.37),
        lambda t63: t63["k_T"] < min(t63["1/J_a"], t63["f_m"]),
    ),
    Check(
        "inertia-and-friction-alike", "section 5.3, Fig. 6",
        "With forgetting the rate is about the same for J_a and f_m",
        "t90 [s] of f_m over that of 1/J_a within 0.6 and 1.7",
        lambda e: e.times("forgetting", 0.10),
        lambda t90: 0.6 <= t90["f_m"] / t90["1/J_a"] <= 1.7,
    ),
    Check(
        "P-differs-with-forgetting", "section 5.3, Fig. 7",
        "With forgetting the diagonal elements of P differ much in magnitude",
        "largest over smallest > 20",
        lambda e: e.mean_P("forgetting"), lambda P: P.max() > 20 * P.min(),
    ),
    Check(
        "P-is-even-with-modification", "section 5.3, Fig. 9, eq. (32)",
        "With Δ = 1e-8 diag(5, 50, 500) the diagonal elements of P have the same magnitude",
        "largest over smallest < 3",
        lambda e: e.mean_P("modification"), lambda P: P.max() < 3 * P.min(),
    ),
    Check(
        "recipe-gives-the-working-P", "section 5.2",
        "The update of P with ψ at nominal gives the P at which the filter then works",
        "P(0) over the mean of diag P in the second half, or the inverse, ≤ 1.15 with both methods",
        Measures.recipe_over_mean, below(1.15),
    ),
    Check(
        "torque-constant-is-slower", "section 5.3, Fig. 8",
        "With covariance modification the convergence rate of k_T is lower",
        "t63 [s] of k_T at least twice that with forgetting",
        Measures.times_of_k_T,
        lambda t63: t63["modification"] > 2 * t63["forgetting"],
    ),
    Check(
        "torque-constant-is-quieter", "section 5.3, Fig. 8",
        "With covariance modification the variance of k_T is lower",
        "standard deviation [%] of k_T below that with forgetting",
        lambda e: e.stds("k_T"), lambda std: std["modification"] < std["forgetting"],
    ),
    Check(
        "friction-is-noisier", "section 5.3, Fig. 8",
        "With covariance modification the variance of f_m is much higher",
        "standard deviation [%] of f_m over 3 times that with forgetting",
        lambda e: e.stds("f_m"), lambda std: std["modification"] > 3 * std["forgetting"],
    ),
    Check(
        "steady-P-with-slow-forgetting", "section 5.2, eq. (29)",
        "For λ close to one P is (1−λ) Q⁻¹", "λ = 0.999: P over theory within 5 % of one",
        lambda e: e.over_theory("slow forgetting"), within(0.95, 1.05),
    ),
    Check(
        "steady-P-with-forgetting", "section 5.2, eq. (29)",
        "At the λ of the paper P is near (1−λ) Q⁻¹", "λ = 0.995: P over theory within 25 % of one",
        lambda e: e.over_theory("forgetting"), within(0.75, 1.25),
    ),
    Check(
        "steady-P-with-slow-modification", "section 5.2, eq. (30)",
        "For a small Δ P solves P Q P = Δ", "Δ/16: P over theory within 15 % of one",
        lambda e: e.over_theory("slow modification"), within(0.85, 1.15),
    ),
    Check(
        "steady-P-with-modification", "section 5.2, eq. (30), (32)",
        "At the Δ of the paper P nearly solves P Q P = Δ",
        "Δ of (32): P over theory within 30 % of one",
        lambda e: e.over_theory("modification"), within(0.7, 1.3),
    ),
    Check(
        "P-grows-with-the-root", "section 5.2, eq. (30)",
        "By P Q P = Δ a Δ that is 16 times as large makes P 4 times as large",
        "P with Δ of (32) over that with Δ/16 between 3.2 and 5",
        lambda e: e.mean_P("modification") / e.mean_P("slow modification"), within(3.2, 5),
    ),
    Check(
        "variance-with-forgetting", "section 5.2, with eq. (29)",
        "With forgetting the variance of an estimate is σ² P/2",
        "standard deviation over √(σ²P/2) within 30 % of one, the mean nearer to it than to √(σ²P)",
        lambda e: e.std_over_claim("forgetting"), half_of_P(0.3),
    ),
    Check(
        "variance-with-modification", "section 5.2, with eq. (30)",
        "With covariance modification, too, the variance of an estimate is σ² P/2",
        "standard deviation over √(σ²P/2) within 40 % of one, the mean nearer to it than to √(σ²P)",
        lambda e: e.std_over_claim("modification"), half_of_P(0.4),
    ),
    Check(
        "regularisation-bounds-forgetting", "section 3.1, eq. (9), (12)",
        "With forgetting and regularisation P comes to (1−λ)/μ without excitation, and no higher",
        "largest P in a standstill of 20 s, over (1−λ)/μ: ≤ 1, and within 2 % of it",
        lambda e: e.peaks_over_bounds("forgetting"), within(0.98, 1 + 1e-9, least=3),
    ),
    Check(
        "regularisation-bounds-modification", "section 3.1, eq. (10), (12)",
        "With covariance modification, regularisation keeps P_ii below √(Δ_ii/μ)",
        "largest P_ii in a standstill of 20 s, over √(Δ_ii/μ): ≤ 1; for the largest μ ≥ 0.98",
        lambda e: e.peaks_over_bounds("modification"),  # a small μ takes longer
        lambda p: within(0, 1 + 1e-9, least=3)(p) and p.iloc[-1] >= 0.98,
    ),
    Check(
        "forgetting-winds-up", "section 3.1; section 5.3, last paragraph",
        "With forgetting and without regularisation P grows without bound at standstill",
        "P grows more than 1e6-fold in 20 s", Measures.growth, above(1e6),
    ),
    Check(
        "drift-from-time-constants", "section 5.3, choice of Δ left open",
        "Δ_ii = 1/(τ_i² Q_ii) gives each estimate the time constant that is wanted",
        "t63 over wanted, or the inverse, ≤ 1.4 from 1.2 s on",
        lambda e: worst([*map(e.t63_over, SLOW)]), below(1.4),
    ),
    Check(
        "time-constants-one-by-one", "section 5.3, choice of Δ left open",
        "The time constants of the parameters can be chosen one by one",
        "t63 over wanted within 1/1.4 … 1.4 of 2.4, 1.2 and 0.6 s",
        lambda e: e.t63_over((2.4, 1.2, 0.6)), within(1 / 1.4, 1.4),
    ),
    Check(
        "variance-of-the-choice", "section 5.3, choice of Δ left open",
        "The variance that a time constant costs is predicted by σ² P/2 with P of eq. (30)",
        "standard deviation over predicted within 20 % of one",
        lambda e: np.mean([*map(e.std_over, SLOW)], axis=0), within(0.8, 1.2),
    ),
    Check(
        "regularisation-stops-the-burst", "section 5.3, regularisation left open",
        "μ = 1 stops the burst of the estimates when the excitation returns after a standstill",
        "burst [%] of θ̂ over 100 without, below 20 with",
        Measures.bursts, lambda burst: burst["μ = 0"] > 100 and burst["μ = 1"] < 20,
    ),
    Check(
        "regularisation-costs-little", "section 5.3, regularisation left open",
        "μ = 1 makes the estimates hardly slower where the axis moves",
        "lag after a fault over that with μ = 0, ≤ 1.15", Measures.prices, within(0, 1.15),
    ),
    Check(
        "reset-shortens-the-lag", "section 5.2, change detection left open",
        "Resetting P to a prior of 3 % at a known change makes the estimates follow faster",
        "lag without over with reset ≥ 1.5 for each",
        lambda e: e.lags("forgetting") / e.lags("forgetting", prior=0.03), above(1.5),
    ),
    Check(
        "reset-can-be-too-large", "section 5.2, change detection left open",
        "A reset to a prior of 100 % throws estimates off before they settle",
        "lag with 100 % over that with 3 %: > 3 for one",
        lambda e: e.lags("forgetting", prior=1.0) / e.lags("forgetting", prior=0.03),
        lambda loss: loss.max() > 3,
    ),
)  # fmt: skip
"""All checks, in the order of the paper."""
