# %% [markdown]
# # Your own axis: from one log to many
#
# You have a geared axis, a controller that logs torque (or current) and motor angle, and a question: *has the axis changed since
# spring?* This notebook takes about a minute and shows all steps: a log, the parameters of the axis with their uncertainty, and a
# change over weeks that is not an effect of the temperature.
#
# This notebook has no access to a robot, so the first cell simulates the logs. A published robot axis (Wernholt and Gunnarsson,
# 2006) performs the same motion for 20 s every morning, and the temperature varies from day to day. From day 10 on, the dry
# friction of the axis grows. Only the last cell uses the true values of the simulation. If you have your own logs, skip the first
# cell.

# %%
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pandas as pd

from flexaxis.estimators.models.axis_models import STATIC, three_mass
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.axis_file import Axis, find_axis
from flexaxis.sim.simulate import simulate

Path("days").mkdir()
motion = find_scenario("wg_fc_step-v1").override({"fault": [], "duration": 20.0})
rng, nominal, true = np.random.default_rng(0), dict(motion.initial), []
for day in range(24):
    kelvin = rng.normal(0, 6)
    warm = 0.99**kelvin * np.exp(rng.normal(0, 0.01, 2))  # −1 % per kelvin, 1 % daily scatter
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

model = replace(three_mass(nominal), laws=(STATIC,))
axis = Axis(model=model, tables={"model": "three_mass"}, known=True)
off = {name: value * (1 + rng.uniform(-0.05, 0.05)) for name, value in axis.model.nominal.items()}
axis.having(off | {"k_T": 1.0, "r": 1.0}).save(Path("days/axis.toml"))

# %% [markdown]
# ## One log
#
# A log is a table. The first line contains the names and units of the columns. If your log has no such line, use the options
# `--torque`, `--angle` and `--unit` ([logs.md](../logs.md)).

# %%
import matplotlib.pyplot as plt

plt.rcParams["figure.dpi"] = 90
first = Path("days/2026-01-01.csv")
log = pd.read_csv(first, comment="#")
log.head(3)

# %% [markdown]
# `import` searches for problems that would otherwise make the estimates wrong without an error message: a shift by one sample,
# clocks that drift apart, clipping, or a motion without reversals. `import` explains each problem and names the option that
# solves the problem.

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
# The model consists of three masses, two springs with dampers, and friction on the motor:
#
# $$ J_m\dot v_m = k_T u - f_m v_m - F(v_m) - r\,\tau_g,\quad
#    J_g\dot v_g = \tau_g - f_g v_g - \tau_a,\quad
#    J_a\dot v_a = \tau_a - f_a v_a, $$
#
# $$ F(v) = \Bigl(f_c + \frac{f_s}{\cosh \alpha v}\Bigr)\tanh \beta v. $$
#
# `days/axis.toml` contains the prior knowledge of the owner: data-sheet values with errors of up to 5 %. `identify` starts from these values,
# simulates the log from its torque, and minimises the prediction errors with a noise model (L. Ljung, *System Identification*, 2nd ed.,
# chapters 7 and 10).
#
# A log contains no information about parameters that its motion does not excite. In this log, these parameters are $f_g$ and
# $f_a$, the friction behind the springs. If you leave both parameters free, `identify` reports that the log does not determine
# them. For this reason, both are fixed at their data-sheet values.

# %%
import flexaxis as fx

data_sheet = find_axis("days/axis.toml")
another = "days/2026-01-05.csv"
result = fx.identify(first, data_sheet, fix={"f_g": None, "f_a": None}, validate=another)
result.save("axis.toml")
fit = result.result
print(result.page.finding.text)

# %%
table = fit.estimates.T[:-2].rename(columns={"value": "estimate"})
table["sd [%]"] = 100 * table["sd"] / table["estimate"]
table["data sheet off by [%]"] = 100 * (pd.Series(data_sheet.model.nominal) / table["estimate"] - 1)
table.style.set_uuid("axis").format(
    {"estimate": "{:.5g}", "sd": "{:.1e}", "sd [%]": "{:.2g}", "data sheet off by [%]": "{:+.1f}"}
)

# %% [markdown]
# The standard deviation is the larger of two values: one from the noise model, and one from the scatter over parts of the log.
# The standard deviations of inertias and stiffnesses are a few hundredths of a per cent. The standard deviation of the breakaway
# torque $f_s$ is one per cent, because $f_s$ acts only when the motor reverses.
#
# Does the model describe the axis, or only the log that was used for the fit? To answer this question, the motion of another
# morning is simulated from the torque alone.

# %%
_ = result.plot(len(result.page.charts) - 1)

# %% [markdown]
# ## Many logs
#
# For the log of each morning, `identify` starts from `axis.toml` and computes estimates with confidence intervals. Then
# `identify` tests whether the estimates in the whole folder change more than a covariate explains. In this example the covariate
# is the temperature, a column of the logs.

# %%
many = fx.identify("days", "axis.toml", covariates=["temp"], free=["f_m", "f_c"])
many

# %% [markdown]
# The answer is: *the dry friction grows, and the temperature is not the cause*. The figure shows the estimates with ± 2 standard
# deviations, and the fitted effects of the temperature and of the change.

# %%
_ = many.plot()

# %% [markdown]
# ## Is the result correct?
#
# Only this cell uses the true values of the simulation.

# %%
f_c = many.table["f_c"].to_numpy()
error = f_c / f_c.mean() - np.array(true) / np.mean(true)
print(f"scatter of the estimation error from day to day: {100 * error.std():.2f} %")

# %% [markdown]
# To continue with your own axis, read [logs.md](../logs.md), which explains `import`, `identify` and `track`, and
# [friction.md](../friction.md#how-to-log-an-axis), which explains how to log an axis.
#
# - E. Wernholt and S. Gunnarsson, *Nonlinear identification of a physically parameterized robot model*, SYSID 2006.
# - L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall, 1999.
