"""Lab 2: the prediction gradient, and the information at each frequency (equation 28)."""

# %% Data
# The record contains 40 s of data from the axis in closed loop, without faults.
import matplotlib.pyplot as plt
import numpy as np

from flexaxis.estimators import three_mass
from flexaxis.estimators.offline.frequency import frequency_response, information, line_spectrum
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.simulate import simulate

scenario = find_scenario("paper_nominal-v1")
record = simulate(scenario, [1000])[0]
names = ("k_T", "1/J_a", "f_m")
model = three_mass(scenario.nominal.as_dict()).parametrize(names)

# %% The gradient over time
# psi is the derivative of the predicted speed with respect to a parameter. If psi is small, the
# estimate of the parameter is slow or noisy.
y_hat, psi = predict(model, model.theta, record.torque, period=0.005)
time_average = np.mean(psi[-4000:] ** 2, axis=0)  # two whole periods, 20 s, in steady state
for name, power in zip(names, time_average, strict=True):
    print(f"mean square of the gradient for {name:6s} {power:8.1f}")

# %% Is psi the derivative?
# Always compare a gradient with finite differences before you use it.
step = 1e-5 * model.theta[2]
only_f_m = np.array([0, 0, step])
up = predict(model, model.theta + only_f_m, record.torque, period=0.005)[0]
down = predict(model, model.theta - only_f_m, record.torque, period=0.005)[0]
error = np.abs((up - down) / (2 * step) - psi[:, 2]).max() / np.abs(psi[:, 2]).max()
print(f"relative error of the gradient for f_m: {error:.1e}")

# %% The same number from the spectrum
# To evaluate equation (28), multiply the power of each spectral line of the torque by the squared
# magnitude of the sensitivity at its frequency, and sum over all lines.
omega, power = line_spectrum(record.torque[-4000:], period=0.005)
from_spectrum = np.diag(information(model, model.theta, omega, power, period=0.005))
ratio = time_average / from_spectrum
print("ratio of the time average of psi^2 to the sum (28):", ratio.round(4))

# %% Contribution of each frequency
# Question 1: which frequencies contain the information about J_a, and which contain the information
# about friction?
# Question 2: excitation causes wear. Which frequency band would you omit if you only needed f_m?
_, slopes = frequency_response(model, model.theta, omega, period=0.005)
share = np.cumsum(np.abs(slopes) ** 2 * power[:, None], axis=0)
share /= share[-1]
for i, name in enumerate(names):
    plt.plot(omega, share[:, i], label=name)
plt.xlim(0, 200)
plt.xlabel("frequency [rad/s]")
plt.ylabel("fraction of the information below this frequency")
plt.legend()
plt.show()
half = {name: omega[np.searchsorted(share[:, i], 0.5)] for i, name in enumerate(names)}
print(
    "frequency below which half of the information lies [rad/s]:",
    {k: round(float(v), 1) for k, v in half.items()},
)

# %% Check
print(f"check: the ratios differ from one by at most {100 * np.abs(ratio - 1).max():.2f} %")
assert error < 1e-5
assert np.abs(ratio - 1).max() < 0.01
assert list(np.argsort(time_average)) == [0, 1, 2], (
    "the gradient must be smallest for k_T and largest for f_m"
)
