"""Lab 7: viscous friction and dry friction, which a linear model cannot distinguish."""

# %% Data
# The friction of the motor is the sum of viscous friction, f_m v, and dry friction, f_c sign(v),
# with f_c = 0.1 N m. At 10 s, f_m increases by 50 % in three records, and f_c increases by 50 % in
# three other records.
import matplotlib.pyplot as plt
import numpy as np

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.true_model import jump_gradient, model_theta, true_model
from flexaxis.sim.simulate import simulate

T, sigma, onset, seeds = 0.005, 0.1, 2000, range(1000, 1003)
scenarios = {p: find_scenario(f"coulomb_{p.replace('_', '')}_step-v1") for p in ("f_m", "f_c")}
records = {p: simulate(scenario, seeds) for p, scenario in scenarios.items()}
nominal = scenarios["f_m"].nominal.as_dict()
f_m, f_c = nominal["f_m"], 0.1

# %% A linear estimator
# If a line through the origin is fitted to f_c sign(v) by least squares, its slope is
# f_c E|v| / E v².
# Question 1: by how much is the estimate of f_m too high? How large would this error be at twice
# the speed?
P0 = known_P(("k_T", "1/J_a", "f_m"), forgetting=0.995)


def linear(record):
    """Return the f_m estimates (N,) of an estimator with a linear model."""
    rpem = Rpem(three_mass(nominal), P0=P0, forgetting=0.995, period=T)
    return rpem.run(record.torque, record.speed)[:, 2]


v = np.array([record.true_speed[:onset] for record in records["f_m"]])
expected = f_c * np.mean(abs(v)) / np.mean(v**2) / f_m
before = slice(1000, onset)
seen = np.mean([linear(record)[before] for record in records["f_m"]]) / f_m - 1
print(f"f_m error of a linear estimator: {100 * seen:+.0f} %, expected {100 * expected:+.0f} %")

# %% An estimator that knows the friction law, but not the values of f_m and f_c
# Question 2: the linear estimator attributes both faults to f_m. What does the estimator with the
# friction law report?
both = {p: [] for p in records}
hits = 0
for p, record in [(p, record) for p, several in records.items() for record in several]:
    knowing = REGISTRY["glr"].factory(nominal, T)
    both[p].append(knowing.run(record.torque, record.speed)[:, 2:])
    found = [f"{' and '.join(f.parameters)} at {T * f.onset:.2f} s" for f in knowing.findings]
    hits += [f.parameters for f in knowing.findings] == [(p,)]
    print(f"{p} +50 % at 10 s; found: {', '.join(found)}")
off = np.mean([theta[before] for theta in both["f_m"]], axis=(0, 1)) / [f_m, f_c] - 1
print("errors before the fault: f_m {:+.1f} %, f_c {:+.1f} %".format(*100 * off))

# %% Figure
figure, axes = plt.subplots(2, 2, sharex=True, sharey="row", layout="constrained")
time = T * np.arange(2 * onset)
for column, p in zip(axes.T, records, strict=True):
    column[0].set_title(f"{p} rises by 50 %")
    column[0].plot(time, linear(records[p][0]), "C1", label="linear")
    for i, axis, value in ((0, column[0], f_m), (1, column[1], f_c)):
        axis.plot(time, both[p][0][:, i], "C0", label="with the law")
        grown = 1.5 if p == ("f_m", "f_c")[i] else 1.0
        axis.plot(time, np.where(time < 10, value, grown * value), "k--", label="truth")
    column[1].set_xlabel("time [s]")
axes[0, 0].set_ylabel("f_m [N m s/rad]")
axes[0, 0].set_ylim(0, 0.12)
axes[1, 0].set_ylabel("f_c [N m]")
axes[1, 0].set_ylim(0, 0.2)
axes[0, 0].legend()
plt.show()


# %% The best possible accuracy of a motion
# In this cell, ψ is the gradient of the model with dry friction. The smallest possible covariance
# of the estimates is the inverse of Σψψᵀ/σ².
# Question 3: point-to-point moves separate f_m from f_c better than the multisine does. However,
# the moves determine neither f_m nor f_c if certain other parameters are unknown. Which parameters
# are these, and why?
def least(scenario, record, unknown):
    """Return the Cramér–Rao bounds [%] on f_m and f_c after 10 s, and their error correlation."""
    theta = scenario.true_parameters()[0]
    model = true_model(scenario, theta).parametrize(unknown)
    at = model_theta(scenario, unknown, theta)
    rest = np.zeros(model.states)
    psi = at * jump_gradient(model, at, record.torque[:onset], rest, period=T)
    C = sigma**2 * np.linalg.inv(psi.T @ psi)
    sd = np.sqrt(np.diag(C))
    return 100 * sd[0], 100 * sd[1], C[0, 1] / sd[0] / sd[1]


moves = find_scenario("coulomb_moves_fm_step-v1")
motions = {
    "multisine": (scenarios["f_m"], records["f_m"][0]),
    "moves": (moves, simulate(moves, [1000])[0]),
}
friction, torque_scale = ("f_m", "f_c"), ("f_m", "f_c", "k_T", "J_m", "k_g", "k_a", "1/J_a")
bounds = {}
print("motion      unknown                  f_m      f_c   correlation")
for label, run in motions.items():
    for unknown in (friction, torque_scale):
        bounds[label, unknown] = least(*run, unknown)
        what = "f_m, f_c" if unknown == friction else "and torque, masses, springs"
        print(
            f"{label:10} {what:28}", "{:6.2f} % {:6.2f} % {:8.2f}".format(*bounds[label, unknown])
        )

# %% Check
print(
    f"check: the error of the linear estimator is {seen / expected:.2f} times the expected error, "
    f"and glr identifies {hits} of {2 * len(seeds)} faults"
)
assert 0.9 < seen / expected < 1.25
assert np.abs(off).max() < 0.03
assert hits >= 5 / 6 * 2 * len(seeds)
assert bounds["multisine", torque_scale][0] < 1 < bounds["moves", torque_scale][0]
