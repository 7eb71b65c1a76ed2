# %% [markdown]
# # Your own estimator, and a fair verdict
#
# You have an idea for a recursive estimator. Is it better than the existing ones? A single run does not answer this question,
# because the tuning parameter of an estimator can make the estimator faster and noisier. This notebook leads from an idea to a
# sound verdict in five steps: a class, the rules, the trade-off between noise and lag, the bound, and a comparison at equal
# noise.

# %%
import matplotlib.pyplot as plt
import numpy as np

import flexaxis as fx
from flexaxis.estimators import Rpem, three_mass
from flexaxis.experiments.reporting.styles import style

plt.rcParams["figure.dpi"] = 90

# %% [markdown]
# ## The idea
#
# The recursive prediction-error method (RPEM) with a forgetting factor λ has a memory of $T/(1-\lambda)$ seconds. With the
# gradient ψ of the predictor and the prediction error ε, the equations are
#
# $$ K = \frac{P\psi}{1 + \psi^\mathsf{T}P\psi},\qquad \hat\theta \leftarrow \hat\theta + K\varepsilon,\qquad
#    P \leftarrow \frac{(I - K\psi^\mathsf{T})P}{\lambda}. $$
#
# A filter with a long memory has little noise, and a filter with a short memory is fast. *The idea is to run two filters*, and to
# use the fast filter whenever it differs from the slow filter by more than the covariance of the fast filter explains:
#
# $$ (\hat\theta_\text{quick}-\hat\theta_\text{slow})^\mathsf{T}\,\Sigma^{-1}\,(\hat\theta_\text{quick}-\hat\theta_\text{slow}) > h^2. $$
#
# An estimator is a class with the members `names`, `output` and `step`. The class does not need to import flexaxis. The attribute
# `knob` names the tuning parameter that trades noise for speed.


# %%
class TwoSpeeds:
    """Run a fast and a slow filter, and use the fast filter while the filters disagree."""

    names = ("k_T", "1/J_a", "f_m")
    knob = "1-forgetting"

    def __init__(self, nominal, period, *, output="speed", forgetting=0.995, ratio=4.0, h=4.0):
        axis, P0 = three_mass(dict(nominal)), np.diag([2.97e-4, 5.19e-5, 4.69e-6]) / 0.005
        self.output, self.h = output, h
        self.slow, self.quick = (
            Rpem(
                axis,
                identify=self.names,
                P0=P0 * nu,
                forgetting=1 - nu,
                period=period,
                output=output,
            )
            for nu in (1 - forgetting, ratio * (1 - forgetting))
        )

    def step(self, u, y):
        slow, quick = self.slow.step(u, y), self.quick.step(u, y)
        apart = quick - slow
        far = apart @ np.linalg.solve(self.quick.covariance, apart) > self.h**2
        return quick if far else slow


# %% [markdown]
# On a single record, the result looks very good. The fault is an increase of the motor friction $f_m$ by 50 % at 10 s.

# %%
record = fx.simulate("fm_step-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot("f_m", band=False)
found = fx.estimate(record, TwoSpeeds)
found.plot("f_m", ax=axes)
axes.set_xlim(8, 16)
axes.figure.set_size_inches(8, 3)
plt.show()
# %%
fx.score(found)

# %% [markdown]
# ## Does the class satisfy the rules?
#
# Scores are worthless if an estimator looks ahead, keeps references to its inputs, or has a `run` that differs from its `step`.

# %%
fx.check(TwoSpeeds)

# %% [markdown]
# ## An unfair comparison
#
# In this comparison, both estimators run with default settings on the same records, with eight seeds:

# %%
unfair = fx.compare("rpem-forgetting", TwoSpeeds, scenarios="fm_step-v1", seeds=8)
unfair

# %% [markdown]
# The new estimator is faster and perhaps noisier before the fault. The verdict is *undecided*, because eight seeds do not
# determine a standard deviation to within 2 %. More seeds would answer the wrong question. Because λ trades noise for speed, you
# must compare the *curves* of both estimators.
#
# ## The trade-off between noise and lag, with the bound
#
# Each estimator is run with four settings of its tuning parameter, $\nu = 1-\lambda$ or `walk`, from a quarter to twice the
# default. The grey line is the Cramér–Rao bound ([scores.md](../scores.md#the-bound)): the smallest lag of an estimator that
# knows the time of the fault and the state at that time.

# %%
turns = [0.25, 0.5, 1, 2]
knobs = {
    name: [f"{name}[forgetting={1 - 0.005 * t:g}]" for t in turns]
    for name in ("rpem-forgetting", "TwoSpeeds")
} | {"glr": [f"glr[walk={7e-4 * t:g}]" for t in turns]}
every = [text for texts in knobs.values() for text in texts]
results = fx.benchmark(every, scenarios="fm_step-v1", seeds=6)
rows = results.scores().query("parameter == 'f_m'").set_index("estimator").to_dict("index")

figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
for name, texts in knobs.items():
    ax.loglog(
        [rows[t]["std"] for t in texts],
        [rows[t]["lag"] for t in texts],
        "o-",
        color=style(name).light,
        label=name,
    )
    ax.loglog(
        rows[texts[2]]["std"],
        rows[texts[2]]["lag"],
        "o",
        color=style(name).light,
        ms=11,
        mfc="none",
    )
bound = results.to_dataframe().query("parameter == 'f_m'")["lag_bound"].mean()
ax.axhline(bound, color="0.5", label="bound")
ax.axvline(rows[knobs["rpem-forgetting"][2]]["std"], color="k", lw=0.7, ls=":")
ax.set(
    xlabel="std of $f_m$ before the fault [%]",
    ylabel="lag after the fault [s]",
    title="circles: λ = 0.995, and the default of glr",
)
ax.legend(frameon=False)
ax.grid(alpha=0.25, which="both")
plt.show()
# %% [markdown]
# Compare the lags along the dotted line, which marks equal noise. `glr` does not use forgetting. The tuning parameter of `glr` is
# the process noise of the parameters, and `glr` is fast because it determines which parameter jumped and when.
#
# ## A fair comparison
#
# With `match_std=True`, both estimators are tuned on separate seeds until their estimates of $f_m$ are as noisy as the estimate
# of `rpem-forgetting` with default settings. On the seeds of the comparison, interpolation between neighbouring settings removes
# the remaining difference. The noise is then equal, and only the lag is compared.

# %%
fair = fx.compare("rpem-forgetting", TwoSpeeds, scenarios="fm_step-v1", seeds=12, match_std=True)
fair

# %%
against_the_best = fx.compare("glr", TwoSpeeds, scenarios="fm_step-v1", seeds=8, match_std=True)
against_the_best.plot()
plt.show()

# %% [markdown]
# The idea is better than forgetting, but far from `glr`, which determines *when* a change occurred and *which* parameter changed
# ([estimators.md](../estimators.md)). If you write the class to a file, you get the same verdict on the command line, with an
# exit status for CI. `flexaxis new mine.py` writes a template of such a file.
#
# ```sh
# flexaxis check mine.py:TwoSpeeds
# flexaxis compare --base glr --candidate mine.py:TwoSpeeds --match-std fm_step-v1
# ```
#
# **Exercises.** How do `ratio` and `h` change the curve? Is the verdict the same for `ja_step-v1`, and for the four scenarios of
# the suite `gate` together? (For several scenarios, the estimators are tuned to equal *excess prediction error*, which is a
# single number for all parameters.)
#
# - L. Ljung and T. Söderström, *Theory and Practice of Recursive Identification*, MIT Press, 1983.
# - P. Tichavský, C. H. Muravchik and A. Nehorai, *Posterior Cramér–Rao bounds for discrete-time nonlinear filtering*, IEEE
#   Trans. Signal Processing 46 (1998), 1386–1396.
