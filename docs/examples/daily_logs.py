"""Simulate daily logs of a robot axis with wear and temperature changes.

To write the logs to a folder, run `python daily_logs.py FOLDER`. The simulated axis (scenario
`wg_fc_step-v1`) repeats the same 20 s motion every morning. The friction falls by 1 % per kelvin.
The dry friction increases by 12 % between day 30 and day 60. The column `temp` of each log contains
the temperature. The file FOLDER/axis.toml contains data-sheet values with errors of up to 5 %.
"""

import sys
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pandas as pd

from flexaxis.estimators.models.axis_models import STATIC, three_mass
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.sim.simulate import simulate

DAYS, FROM, WEAR, PER_KELVIN = 60, 30, 0.12, -0.01

folder = Path(sys.argv[1])
folder.mkdir(exist_ok=True)
rng = np.random.default_rng(0)
motion = find_scenario("wg_fc_step-v1").override({"fault": [], "duration": 20.0})
nominal = dict(motion.initial)
for day in range(DAYS):
    kelvin = rng.normal(0, 6)
    warm = (1 + PER_KELVIN) ** kelvin * np.exp(rng.normal(0, 0.01, 2))  # 1 % daily scatter
    worn = 1 + WEAR * np.clip((day + 1 - FROM) / (DAYS - FROM), 0, 1)
    friction = {
        "parameters.f_m": nominal["f_m"] * warm[0],
        "static_friction.f_c": nominal["f_c"] * warm[1] * worn,
    }
    record = simulate(motion.override(friction, inherit=True), [0], repeat=day)[0]
    log = pd.DataFrame({"time [s]": record.time, "torque [Nm]": record.torque})
    log["angle [rad]"], log["speed [rad/s]"] = record.angle, record.speed
    log["temp"] = np.round(25 + kelvin + rng.normal(0, 0.1, len(log)), 1)
    name = f"{date(2026, 1, 1) + timedelta(days=day)}.csv"
    log.to_csv(folder / name, index=False, float_format="%.10g")

# In the data sheet, only the torque constant and the gear ratio are exact, because a log cannot
# determine them.
law = replace(three_mass(nominal), laws=(STATIC,))
sheet = {name: v * (1 + rng.uniform(-0.05, 0.05)) for name, v in law.nominal.items()}
axis = Axis(model=law, tables={"model": "three_mass"}, known=True)
axis.having(sheet | {"k_T": 1.0, "r": 1.0}).save(folder / "axis.toml")
