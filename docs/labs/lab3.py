"""Lab 3, forgetting: the trade-off between speed and variance, in theory and in experiment."""

# %% Theory in two lines
# With forgetting, P converges to (1 - lambda) Q^-1 (equation 29), the variance of the estimate is
# sigma^2 P / 2, and an error decays as lambda^k. You can predict these three quantities before an
# experiment.
import matplotlib.pyplot as plt
import numpy as np

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.frequency import information, line_spectrum
from flexaxis.estimators.offline.priors import estimate_covariance, steady_P
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.simulate import simulate

SEEDS = range(1000, 1006)
LAMBDAS = (0.98, 0.99, 0.995, 0.999)  # in ascending order; the check needs 0.995
names, T, sigma = ("k_T", "1/J_a", "f_m"), 0.005, 0.1
scenario = find_scenario("fm_step-v1").override(
    {"name": "lab3", "duration": 40.0, "fault[0].at": 30.0}
)
records = simulate(scenario, SEEDS)
axis = three_mass(scenario.nominal.as_dict())
model = axis.parametrize(names)
nominal, onset = model.theta, round(30 / T)

quiet = slice(2000, 6000)  # two periods of the excitation, before the fault
Q = information(
    model, nominal, *line_spectrum(records[0].torque[quiet], period=0.005), period=0.005
)

# %% Experiment
# The motor friction rises by 50 % at 30 s. We measure the noise of the estimate before the fault
# and the lag of the estimate after the fault.
rows = []
for forgetting in LAMBDAS:
    P = steady_P(Q, forgetting=forgetting)
    theory = np.sqrt(estimate_covariance(P, sigma**2)[2, 2])
    noise, lag = [], []
    for record in records:
        rpem = Rpem(axis, P0=P, forgetting=forgetting, period=0.005)
        f_m = rpem.run(record.torque, record.speed)[:, 2]
        noise.append(np.mean((f_m[quiet] - nominal[2]) ** 2))
        lag.append(T * np.sum(np.abs(f_m[onset : onset + 1000] / nominal[2] - 1.5)) / 0.5)
    rows.append(
        (forgetting, theory / nominal[2], np.sqrt(np.mean(noise)) / nominal[2], np.mean(lag))
    )

# %% Comparison of theory and experiment
# Question 1: by what factor does the standard deviation change if the memory is half as long?
# Question 2: the lag is longer than the memory T/(1 - lambda). Which assumption is wrong? (lambda =
# 0.999 is an exception: the lag is measured over 5 s, so it cannot exceed 5 s.)
print("lambda   std theory   std measured   lag [s]   T/(1-lambda) [s]")
for forgetting, theory, measured, lag in rows:
    print(
        f"{forgetting:6g} {100 * theory:10.3f} % {100 * measured:12.3f} %"
        f" {lag:9.2f} {T / (1 - forgetting):14.2f}"
    )
_, theory, measured, lag = np.array(rows).T
plt.loglog(100 * measured, lag, "o-")
plt.xlabel("standard deviation of f_m before the fault [%]")
plt.ylabel("lag after the fault [s]")
plt.show()

# %% Check
at = LAMBDAS.index(0.995)
ratio = measured[at] / theory[at]
print(f"check: the measured std at lambda = 0.995 is {ratio:.2f} times the predicted std")
assert 0.85 < ratio < 1.2
assert np.all(np.diff(lag) > 0) and np.all(np.diff(measured) < 0), "a faster filter must be noisier"
