"""Lab 5: windup of an estimator while the axis is at rest, and the effect of mu."""

# %% A pause
# The axis moves for 10 s, is at rest for 20 s, and moves again. While the axis is at rest, the
# motor friction increases by 50 %.
import matplotlib.pyplot as plt
import numpy as np

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.simulate import simulate

FORGETTING = 0.995
scenario = find_scenario("pause_fm_step-v1")
record = simulate(scenario, [1000])[0]
axis = three_mass(scenario.nominal.as_dict())
names, restart = ("k_T", "1/J_a", "f_m"), 6000
truth = axis.parametrize(names).theta * [1, 1, 1.5]


# %% Three values of mu
# While psi is zero, forgetting divides P by lambda in every sample. In 20 s, forgetting therefore
# divides P by 0.995^4000.
# Question 1: by what factor does P grow?
# Question 2: at which value does equation (12) stop the growth of P?
def run(mu):
    """Return the largest eigenvalue of P, and the estimates divided by the true values.

    The shapes are (N,) and (N, 3), where N is the number of samples.
    """
    rpem = Rpem(
        axis,
        P0=known_P(names, forgetting=FORGETTING),
        forgetting=FORGETTING,
        regularization=mu,
        period=0.005,
        ceiling=np.inf,  # so that only mu limits P, as in the paper
    )
    trace = rpem.trace(record.torque, record.speed)
    return np.linalg.eigvalsh(trace.P)[:, -1], trace.theta / truth


results = {mu: run(mu) for mu in (0.0, 0.03, 0.3)}

# %% Figure
figure, (above, below) = plt.subplots(2, 1, sharex=True)
for mu, (largest, theta) in results.items():
    above.semilogy(record.time, largest, label=f"mu {mu:g}")
    below.plot(record.time, theta[:, 1].clip(0.5, 1.5))
above.set_ylabel("largest eigenvalue of P")
above.legend()
below.set_ylabel("1/J_a / true value")
below.set_xlabel("time [s]")
plt.show()

# %% The error after the restart
# Question 3: if mu is much too large, how does it affect the estimates while the axis moves?
print("  mu     peak of P   (1-lambda)/mu   largest error of k_T and 1/J_a after the restart")
for mu, (largest, theta) in results.items():
    bound = (1 - FORGETTING) / mu if mu else np.inf
    burst = np.abs(theta[restart : restart + 400, :2] - 1).max()
    print(f"{mu:5.2f} {largest.max():12.3g} {bound:12.3g} {100 * burst:12.1f} %")

# %% Check
largest, theta = results[0.3]
bound = (1 - FORGETTING) / 0.3
bursts = [np.abs(t[restart : restart + 400, :2] - 1).max() for _, t in results.values()]
print(
    f"check: the peak of P is {largest.max() / bound:.3f} times the bound, "
    f"and the largest relative error after the restart is {bursts[-1]:.3f}"
)
assert 0.9 < largest.max() / bound <= 1 + 1e-9
assert results[0.0][0].max() > 1e3 * bound, "without mu, P winds up"
assert bursts[-1] < 0.1 < bursts[0]
