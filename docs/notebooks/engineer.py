# %% [markdown]
# # An axis of your own: from a log to many
#
# You have a geared axis, a controller that logs torque (or current) and motor angle, and a question: *is it the
# same axis as in spring?* This notebook goes the whole way in a minute: a log, the parameters of the axis with
# their uncertainty, and a change over weeks that is no effect of the temperature.
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
import flexaxis as fx

data_sheet = find_axis("days/axis.toml")
another = "days/2026-01-05.csv"
result = fx.identify(first, data_sheet, fix={"f_g": None, "f_a": None}, validate=another)
result.save("axis.toml")
fit = result.result
print(result.page.finding.text)

# %%
table = pd.DataFrame({"estimate": fit.theta, "sd": fit.deviations}, index=fit.names)
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
# Does the model describe the axis, or only the log that it was fitted to? Another morning tells: its motion is simulated from the
# torque of that log alone.

# %%
_ = result.plot(len(result.page.charts) - 1)

# %% [markdown]
# ## Many logs
#
# Every morning's log gives estimates with intervals, from `axis.toml` on. `identify` of the whole folder looks for a change in
# them, beside what a covariate explains; here the temperature, a column of the logs.

# %%
many = fx.identify("days", "axis.toml", covariates=["temp"], free=["f_m", "f_c"])
many

# %% [markdown]
# That is the answer: *the dry friction grows, and it is not the cold*. The figure is what the sentences rest on: estimates with
# ± 2 standard deviations, and the line that temperature and change explain.

# %%
_ = many.plot()

# %% [markdown]
# ## Was it right?
#
# Only here is the simulation asked.

# %%
f_c = many.table["f_c"].to_numpy()
error = f_c / f_c.mean() - np.array(true) / np.mean(true)
print(f"estimates against the truth: {100 * error.std():.2f} % from day to day")

# %% [markdown]
# What comes next for an axis of yours: [logs.md](../logs.md) from `import` to `track`, and [friction.md](../friction.md#how-to-log-an-axis) on the motion to log.
#
# - E. Wernholt and S. Gunnarsson, *Nonlinear identification of a physically parameterized robot model*, SYSID 2006.
# - L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall, 1999.
