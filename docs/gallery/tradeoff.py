"""
The trade-off between lag and noise for several forgetting factors
==================================================================

A comparison of estimators at a single setting is not fair, because every estimator can be made
faster at the cost of more noise.
"""

import matplotlib.pyplot as plt

import flexaxis as fx

factors = (0.98, 0.99, 0.995, 0.9975)
runs = [f"rpem-forgetting[forgetting={factor}]" for factor in factors]
lines = fx.benchmark(runs, scenarios="fm_step-v1", seeds=3).to_dataframe()
f_m = lines[lines.parameter == "f_m"].groupby("estimator")[["std", "lag"]].mean().loc[runs]

plt.loglog(f_m["std"], f_m["lag"], "o-")
for factor, (std, lag) in zip(factors, f_m.to_numpy(), strict=True):
    plt.annotate(f"λ = {factor}", (std, lag), xytext=(6, 4), textcoords="offset points")
plt.xlabel("standard deviation of $f_m$ before the fault [%]")
plt.ylabel("lag after the fault [s]")
