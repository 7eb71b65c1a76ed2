"""Lab 4: design the matrix Delta for a desired tracking speed of each parameter."""

# %% The design rule
# Covariance modification adds Delta to P in every sample (equation 10). In steady state
# P Q P = Delta (equation 30), and an error decays as exp(-P Q k). For a desired time constant tau_i
# (in samples), choose Delta_ii = 1/(tau_i^2 Q_ii).
import matplotlib.pyplot as plt
import numpy as np

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.frequency import information, line_spectrum
from flexaxis.estimators.offline.priors import drift_for, steady_P, tracking_error
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.simulate import simulate

names, T = ("k_T", "1/J_a", "f_m"), 0.005
SEEDS = range(1000, 1004)
scenario = find_scenario("fm_step-v1").override({"name": "lab4", "fault[0].factor": 1.1})
records = simulate(scenario, SEEDS)
axis = three_mass(scenario.nominal.as_dict())
model = axis.parametrize(names)
onset = 2000
Q = information(
    model, model.theta, *line_spectrum(records[0].torque[:onset], period=0.005), period=0.005
)
print("diagonal of Q:", np.diag(Q).round(1))
correlation = Q[0, 2] / np.sqrt(Q[0, 0] * Q[2, 2])
print(f"correlation of the gradients for k_T and f_m: {correlation:.2f}")


# %% Three designs
# In the three designs, the time constant of f_m is 0.5, 1 and 2 s. The time constant of the other
# two parameters is always 2 s.
# Question 1: how do the noise of f_m and the noise of k_T change from design to design?
def experiment(tau):
    """Return the times, the predicted and measured f_m errors, and the f_m noise.

    The times and the errors have the shape (1000,).
    """
    Delta = drift_for([2.0, 2.0, tau], Q, period=0.005)
    P = steady_P(Q, drift=Delta)
    after = T * np.arange(1000)
    predicted = tracking_error(P, Q, after, period=0.005)[:, 2, 2]
    runs = []
    for record in records:
        rpem = Rpem(axis, P0=P, drift=Delta, period=0.005)
        runs.append(rpem.run(record.torque, record.speed)[:, 2] / model.theta[2])
    mean = np.mean(runs, axis=0)
    noise = np.sqrt(np.mean((np.array(runs)[:, 1000:onset] - 1) ** 2))
    return after, predicted, (1.1 - mean[onset : onset + 1000]) / 0.1, noise


results = {tau: experiment(tau) for tau in (0.5, 1.0, 2.0)}

# %% Predicted and measured
# Question 2: the off-diagonal elements of Q make the tracking of f_m slower. What would be
# different with a full matrix Delta (`drift_for(..., coupled=True)`)?
lags = {}
for tau, (after, predicted, measured, noise) in results.items():
    (line,) = plt.plot(after, measured, label=f"tau {tau} s")
    plt.plot(after, predicted, "--", color=line.get_color())
    lags[tau] = T * predicted.sum(), T * measured.sum()
    print(
        f"tau = {tau:3.1f} s: predicted lag {lags[tau][0]:.2f} s, "
        f"measured lag {lags[tau][1]:.2f} s, noise {100 * noise:.2f} %"
    )
plt.xlabel("time after the fault [s]")
plt.ylabel("error of f_m / fault size")
plt.legend()
plt.show()

# %% Check
ratio = lags[1.0][1] / lags[1.0][0]
noises = [noise for *_, noise in results.values()]
print(
    f"check: for tau = 1 s the measured lag is {lags[1.0][1]:.2f} s, "
    f"which is {ratio:.2f} times the predicted lag"
)
assert 0.9 < ratio < 1.4
assert 0.8 < lags[1.0][1] < 1.6, "the lag must be close to the desired time constant"
assert noises[0] > noises[1] > noises[2], "a faster design must be noisier"
