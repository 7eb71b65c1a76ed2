# %% [markdown]
# # A study of faults: how large, and with how much friction?
#
# A fault-injection study varies several conditions and answers three questions: which faults an estimator detects, how fast it
# detects them, and under which conditions a good estimator stops working. This notebook varies two conditions: the **size** of a
# fault in the viscous friction $f_m$, and the **dry friction**, which a linear model does not include. The result is a table with
# one row for each case. All numbers below are computed from this table.

# %%
import matplotlib.pyplot as plt
import numpy as np

import flexaxis as fx
from flexaxis.experiments.reporting.styles import style

plt.rcParams["figure.dpi"] = 90

# %% [markdown]
# ## The axis and its fault
#
# In the scenario `coulomb_fm_step-v1` the motor has dry friction $f_c\,\mathrm{sign}(v)$ in addition to the viscous friction $f_m
# v$. The model of a linear estimator has only $f_m$, so the estimator attributes the dry friction to $f_m$. For a Gaussian speed,
# the error is ([friction.md](../friction.md))
#
# $$ \hat f_m - f_m \approx f_c\,\frac{\mathrm E|v|}{\mathrm E v^2} = \sqrt{\tfrac{2}{\pi}}\,\frac{f_c}{v_\text{rms}}. $$

# %%
record = fx.simulate("coulomb_fm_step-v1", seed=0)
axes = fx.estimate(record, "cusum-reset").plot("f_m", band=False)  # grey: burn-in
fx.estimate(record, "glr").plot("f_m", ax=axes, band=False)
axes.figure.set_size_inches(8, 3)
plt.show()
# %% [markdown]
# ## The plan
#
# A study sweeps dotted keys of a scenario and runs all combinations of their values. Each seed is an independent run with
# different noise and excitation. `flexaxis study FILE.toml` runs a study from a file, on all cores or on a cluster
# ([studies.md](../studies.md)).

# %%
factors, levels = [1.1, 1.5, 3.0], [0.001, 0.03, 0.1]
results = fx.study(
    {
        "scenario": "coulomb_fm_step-v1",
        "estimators": ["rpem-forgetting", "cusum-reset", "glr"],
        "seeds": 2,
        "override": {"duration": 15.0},
        "sweep": {"fault[0].factor": factors, "friction.coulomb": levels},
    }
)
results

# %% [markdown]
# ## The table
#
# The table has one row per scenario, estimator, seed and parameter, and a column for each swept key. The other tracked parameters
# ($k_T$, $1/J_a$, and $f_c$ for estimators with a friction law) also have rows. The following cells use only the rows of $f_m$,
# because the fault is in $f_m$.

# %%
frame = results.to_dataframe().query("parameter == 'f_m'")
frame[
    [
        "estimator",
        "fault[0].factor",
        "friction.coulomb",
        "seed",
        "lag",
        "t10",
        "std",
        "bias",
        "lag_bound",
    ]
].head(4)

# %% [markdown]
# ## The bias before the fault
#
# First, compare the formula above with the measured bias. With dry friction of 0.1 N m, the bias of the linear estimators before
# the fault is a third of $f_m$. This is a few per cent more than the formula for a Gaussian speed predicts.

# %%
bias = frame.groupby(["estimator", "friction.coulomb"])["bias"].mean().unstack(0)
bias["formula (linear)"] = (
    100 * np.sqrt(2 / np.pi) * np.array(levels) / 5.0 / 0.05
)  # v_rms 5 rad/s, f_m .05
bias.round(1)

# %% [markdown]
# ## Lag against the size of the fault, with the bound
#
# The lag is $T\sum|\tilde\theta|/D$ over 5 s after the fault, where $D$ is the size of the fault. The grey line is the bound: the
# smallest lag of an estimator that knows the time of the fault, if $k_T$, $1/J_a$, $f_m$ and $f_c$ are unknown after the fault.
# Averages of lags are geometric means.

# %%
names = ["rpem-forgetting", "cusum-reset", "glr"]
figure, panels = plt.subplots(1, len(levels), sharey=True, figsize=(9, 3.6), layout="constrained")
pooled = frame.assign(log=np.log(frame["lag"])).groupby(
    ["friction.coulomb", "estimator", "fault[0].factor"]
)["log"]
for ax, level in zip(panels, levels, strict=True):
    for name in names:
        found = [np.exp(pooled.get_group((level, name, factor))) for factor in factors]
        growth = [100 * (factor - 1) for factor in factors]
        ax.loglog(
            growth,
            [np.exp(np.log(f).mean()) for f in found],
            "o-",
            color=style(name).light,
            label=name,
        )
        ax.vlines(
            growth,
            [f.min() for f in found],
            [f.max() for f in found],
            color=style(name).light,
            lw=1,
        )
    bound = frame[frame["friction.coulomb"] == level].groupby("fault[0].factor")["lag_bound"].mean()
    ax.loglog(100 * (bound.index - 1), bound, color="0.5", lw=1.5, label="bound")
    ax.axhline(5.0, color="k", lw=0.7, ls=":")
    ax.set(title=f"$f_c$ = {level:g} N m", xlabel="increase of $f_m$ [%]")
    ax.set_xticks(growth, [f"{g:.0f}" for g in growth], minor=False)
    ax.set_xticks([], minor=True)
    ax.grid(alpha=0.25, which="both")
panels[0].set_ylabel("lag [s]  (dotted: no reaction)")
panels[1].legend(frameon=False, fontsize=8)
plt.show()
# %% [markdown]
# The figure shows three results.
#
# 1. With forgetting, larger faults are not easier to track. With almost no dry friction, the lag of `rpem-forgetting` increases
#    with the size of the fault, from 1.2 s to 2.6 s. The lag of `cusum-reset` has a minimum at the middle size. The lag of `glr`
#    decreases with the size of the fault, like the bound. With more dry friction, the bias of the two linear estimators increases
#    the lag for small faults.
# 2. Dry friction of a few hundredths of a newton metre makes a linear estimator useless for small faults. If the *bias* is larger
#    than the fault, the lag is longer than 5 s, the lag of an estimator that never reacts.
# 3. The model of `glr` includes a friction law, and for faults of +10 % and +50 % dry friction hardly changes the lag of `glr`.
#    The lag may be below the bound, because the bound assumes four unknown parameters after the fault. An estimator that
#    identifies the changed parameter has only one parameter to estimate. For a fault of +200 %, `glr` names the wrong parameter
#    in two of the four runs with 0.03 and 0.1 N m (once $J_a$, once $f_c$). In these two runs the lag of `glr` is 4.7 s and 0.5
#    s, compared with about 0.1 s in the other two runs. The line shows geometric means of two runs and hides this difference,
#    but the bars show it.
#
# ## Detections
#
# An estimator that reports detections has additional scores: the number of missed faults, the number of false alarms, and the
# fraction of faults for which it names the correct parameter.

# %%
seen = frame[frame["estimator"] == "glr"].groupby("friction.coulomb")
seen[["detection.missed", "detection.false_alarms", "detection.isolated"]].mean().astype(
    float
).round(2)

# %% [markdown]
# Two seeds are enough for a first impression, but not for a paper. For a paper, use 60 seeds and store the rows
# (`folder="results/friction"`), so that you can resume an interrupted run. Before you rank estimators, tune them to equal noise
# ([developer.ipynb](developer.ipynb)).
#
# - B. Armstrong-Hélouvry, P. Dupont and C. Canudas de Wit, *A survey of models, analysis tools and compensation methods for the
#   control of machines with friction*, Automatica 30 (1994), 1083–1138.
# - H. L. van Trees, *Detection, Estimation, and Modulation Theory*, part I, Wiley, 1968 (the Bayesian bound).
