"""Lab 8: the benefit of parameter tracking for the controller."""

# %% Data
# The controller in these scenarios feeds forward (f_m v + J a) / k_T, the torque that the desired
# motion requires. In the first scenario, f_m increases by 50 % during the run. In the second
# scenario, the inertia of the arm doubles.
import matplotlib.pyplot as plt
import numpy as np

import flexaxis as fx
from flexaxis.experiments.catalogue.find import find_scenario

seed, short = 1000, {"duration": 11.0, "fault[0].at": 5.4, "burn_in": 2.0}
scenarios = {
    "f_m": find_scenario("control_fm_moves-v1").override(short),
    "J_a": find_scenario("control_ja_moves-v1").override(short),
}
memory = (0.98, 0.99, 0.995, 0.998)
names = [f"rpem-forgetting[forgetting={x}]" for x in memory]

# %% Without an estimator
# Question 1: the controller has integral action. Why does it not compensate for the friction that
# the feed-forward omits?
rows = {}
for p, scenario in scenarios.items():
    table = fx.benchmark(names, scenarios=scenario, seeds=[seed]).to_dataframe()
    rows[p] = table.set_index(["estimator", "parameter"])
    errors = 1000 * rows[p].filter(like="tracking").iloc[0]
    for name in ("without_fault", "frozen", "told"):
        print(f"{p} {name}: {errors[f'tracking.{name}']:.2f} mrad")

# %% With an estimator
# Question 2: does the estimator with the smallest lag recover the largest part of the lost
# accuracy? What other property of the estimates is important?
# Question 3: even with a lag of 4 s (the maximum is 5 s), most of the loss due to J_a is recovered.
# Why is this possible? Which parameters other than J_a has the estimator changed?
lags, worths = {}, {}
for p, parameter in (("f_m", "f_m"), ("J_a", "1/J_a")):
    lags[p] = np.array([rows[p]["lag"][name, parameter] for name in names])
    worths[p] = np.array([rows[p]["recovered"][name, parameter] for name in names])
    for x, lag, worth in zip(memory, lags[p], worths[p], strict=True):
        print(f"{p}, λ = {x}: lag {lag:.2f} s, {worth:.0f} % recovered")

# %% Figure
figure, axis = plt.subplots(layout="constrained")
for p in scenarios:
    axis.plot(lags[p], worths[p], "o-", label=p)
axis.axhline(100, color="k", ls="--", lw=1)
axis.set(xlabel="lag [s]", ylabel="recovered [%]")
axis.legend()

# %% Check
# A controller that uses the true values must recover nearly all of the lost accuracy, and the
# slowest estimator must recover less than the other estimators.
told = rows["f_m"]["recovered_told"].iloc[0]
least = min(worths[p][:-1].min() - worths[p][-1] for p in scenarios)
print(
    f"check: the true values recover {told:.0f} % of the lost accuracy, and the slowest estimator "
    f"recovers at least {least:.0f} percentage points less than the others"
)
assert told > 90
assert least > 0
plt.show()
