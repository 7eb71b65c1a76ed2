# %% [markdown]
# # An axis of your own: from a log to a trend
#
# You have a geared axis, a controller that logs torque (or current) and motor angle, and a question: *is it the
# same axis as in spring?* This notebook goes the whole way in a minute: a log, the parameters of the axis with
# their uncertainty, and a trend over weeks that tells wear from warmth.
#
# There is no robot beside this page, so the first cell simulates the logs. A published robot axis (Wernholt and Gunnarsson,
# 2006) makes the same motion for 20 s every morning, in a hall that is colder on some days than on others. From day 10
# on its dry friction grows. Nothing below uses what the simulation knows, except the last cell. With logs of your own, leave
# the first cell out.

# %%
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pandas as pd

from flexaxis.estimators.models.axes import STATIC, three_mass
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.axis_file import Axis, find_axis
from flexaxis.sim.simulate import simulate

Path("days").mkdir()
motion = find_scenario("wg_fc_step-v1").override({"fault": [], "duration": 20.0})
rng, nominal, true = np.random.default_rng(0), dict(motion.initial), []
for day in range(24):
    kelvin = rng.normal(0, 6)
    warm = 0.99**kelvin * np.exp(rng.normal(0, 0.01, 2))  # −1 % a kelvin, and 1 % from day to day
    true.append(warm[1] * (1 + 0.12 * max(day - 9, 0) / 14))
    friction = {
        "parameters.f_m": nominal["f_m"] * warm[0],
        "static_friction.f_c": nominal["f_c"] * true[-1],
    }
    record = simulate(motion.override(friction, inherit=True), [0], repeat=day)[0]
    log = pd.DataFrame({"time [s]": record.time, "torque [Nm]": record.torque})
    log["angle [rad]"], log["speed [rad/s]"] = record.angle, record.speed
    log["temp"] = np.round(25 + kelvin + rng.normal(0, 0.1, len(log)), 1)
    log.to_csv(f"days/{date(2026, 1, 1) + timedelta(days=day)}.csv", index=False)

axis = Axis(replace(three_mass(nominal), laws=(STATIC,)), {"model": "three_mass"}, known=True)
off = {name: value * (1 + rng.uniform(-0.05, 0.05)) for name, value in axis.model.nominal.items()}
axis.having(off | {"k_T": 1.0, "r": 1.0}).save(Path("days/axis.toml"))

# %% [markdown]
# ## One log
#
# A log is a table. Names and units of its columns are read from the first line; `--torque`, `--angle` and `--unit` say what
# that line does not ([logs.md](../logs.md)).

# %%
import json
import sqlite3

import matplotlib.pyplot as plt

plt.rcParams["figure.dpi"] = 90
first = Path("days/2026-01-01.csv")
log = pd.read_csv(first, comment="#")
log.head(3)

# %% [markdown]
# `import` looks for what would spoil every estimate without a word: a shift by one sample, clocks that drift apart, clipping,
# a motion in which nothing reverses. It says in words what it doubts, and what to type against it.

# %%
# !flexaxis import days/2026-01-01.csv -o rec.nc -q

# %%
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 3.6), layout="constrained")
above.plot(log["time [s]"], log["torque [Nm]"], lw=0.8)
below.plot(log["time [s]"], log["speed [rad/s]"], lw=0.8, color="#D55E00")
above.set(ylabel="torque [N m]", xlim=(4, 8))
below.set(ylabel="motor speed [rad/s]", xlabel="time [s]")
plt.show()
# %% [markdown]
# ## The parameters
#
# The model is three masses, two springs with dampers, and friction on the motor:
#
# $$ J_m\dot v_m = k_T u - f_m v_m - F(v_m) - r\,\tau_g,\quad
#    J_g\dot v_g = \tau_g - f_g v_g - \tau_a,\quad
#    J_a\dot v_a = \tau_a - f_a v_a, $$
#
# $$ F(v) = \Bigl(f_c + \frac{f_s}{\cosh \alpha v}\Bigr)\tanh \beta v. $$
#
# `days/axis.toml` holds what the owner knew before: data sheets, up to 5 % off. `identify` starts there, simulates the log from
# its torque, and fits by prediction errors with a model of the noise (L. Ljung, *System Identification*, 2nd ed., chapters 7
# and 10).
#
# What a motion does not excite cannot be found in its log. The friction behind the springs, $f_g$ and $f_a$, is such a
# parameter here: left free, it would be answered with *the excitation cannot see f_g*. So both stay as the data sheet has them.

# %%
from flexaxis.experiments.logs.identification.identify import identify
from flexaxis.experiments.logs.importing import import_any

record = import_any(first, {}).record
data_sheet = find_axis("days/axis.toml")
found = identify(record, data_sheet, fix=("f_g", "f_a"))
found.axis.save(Path("axis.toml"))
print(
    f"law of friction: {found.friction}; the torque alone explains {found.fit:.1f} % of the motion"
)
for warning in found.warnings:
    print("!", warning)

# %%
table = pd.DataFrame({"estimate": found.theta, "sd": found.deviations}, index=found.names)
table["sd [%]"] = 100 * table["sd"] / table["estimate"]
table["data sheet off by [%]"] = 100 * (pd.Series(data_sheet.model.nominal) / table["estimate"] - 1)
table.style.set_uuid("axis").format(
    {"estimate": "{:.5g}", "sd": "{:.1e}", "sd [%]": "{:.2g}", "data sheet off by [%]": "{:+.1f}"}
)

# %% [markdown]
# The standard deviation is the larger of two: that for the noise as it was modelled, and that from the scatter over pieces of
# the log. Inertias and stiffnesses are known to some hundredths of a per cent; the breakaway level $f_s$ to a per cent only, for it
# acts in the instants of reversal alone.
#
# Does the model describe the axis, or only the log that it was fitted to? Another morning tells: the simulation is given the
# torque of that log alone, the prediction also the motion up to the sample before.

# %%
from flexaxis.experiments.logs.identification.validate import validate

another = import_any(Path("days/2026-01-05.csv"), {}).record
tried = validate(another, found.axis)
_, axis = plt.subplots(figsize=(8, 3))
for name in ("measured", "simulated", "predicted"):
    axis.plot(tried.time[1000:1400], getattr(tried, name)[1000:1400], lw=0.9, label=name)
axis.set(xlabel="time [s]", ylabel="speed [rad/s]")
_ = axis.legend()

# %% [markdown]
# ## The trend
#
# Every morning's log gives estimates with intervals, from `axis.toml` on. `trend` looks for steps and ramps in them, beside what
# a covariate explains; here the temperature, a column of the logs.

# %%
# !flexaxis trend days --model axis.toml --covariate temp -o trend -q

# %% [markdown]
# That is the answer: *the dry friction grows, and it is not the cold*. Here is what the sentence rests on. Left, $f_c$ as
# estimated, with ± 2 standard deviations: warm days hide the wear. Right, the same less what the temperature explains.

# %%
told = json.loads(Path("trend/trend.json").read_text())
rows = [
    json.loads(line)
    for (line,) in sqlite3.connect("trend/rows.sqlite").execute("SELECT line FROM lines")
]
rows.sort(key=lambda row: row["log"])
f_c = np.array([row["estimates"]["f_c"]["value"] for row in rows])
sd = np.array([row["estimates"]["f_c"]["sd"] for row in rows])
temperature = np.array([row["columns"]["temp"] for row in rows])
verdict = told["parameters"]["f_c"]
warmth = verdict["covariates"]["temp"]["slope"] * (temperature - temperature.mean())
start, day = np.median(f_c[:9]), np.arange(1, len(rows) + 1)

figure, axes = plt.subplots(1, 2, sharey=True, figsize=(8, 3.4), layout="constrained")
for ax, values, title in (
    (axes[0], f_c, "as estimated"),
    (axes[1], f_c / (1 + warmth), "less the warmth"),
):
    points = ax.scatter(day, 100 * (values / start - 1), c=temperature, cmap="coolwarm", zorder=3)
    ax.errorbar(day, 100 * (values / start - 1), 200 * sd / start, fmt="none", ecolor="0.6", lw=1)
    ax.set(xlabel="day", title=title)
    ax.grid(alpha=0.25)
for change in verdict["changes"]:
    axes[1].axvline(change["time"] + 1, color="k", lw=0.8)
axes[0].set_ylabel("$f_c$ [% of the first days]")
figure.colorbar(points, label="temperature [°C]")
plt.show()
# %% [markdown]
# ## Was it right?
#
# Only here is the simulation asked.

# %%
error = f_c / f_c.mean() - np.array(true) / np.mean(true)
print(f"estimates against the truth: {100 * error.std():.2f} % from day to day")

# %% [markdown]
# What comes next for an axis of yours: [logs.md](../logs.md) from `import` to `track`, [trend.md](../trend.md) on what the words
# of a trend promise, and [friction.md](../friction.md#how-to-log-an-axis) on the motion to log.
#
# - E. Wernholt and S. Gunnarsson, *Nonlinear identification of a physically parameterized robot model*, SYSID 2006.
# - L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall, 1999.
