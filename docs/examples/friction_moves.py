"""Estimate the motor friction from a work cycle, with an unknown and a known torque constant."""

import numpy as np

from flexaxis.estimators.models.axis_models import N1
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.simulate import simulate

scenario = find_scenario("coulomb_moves_fm_step-v1")  # f_c = 0.1 N m; f_m +50 % at 10.35 s
records = simulate(scenario, range(1000, 1006))
k_T_known = {"glr": {"identify": ("f_m",), "track": ("f_c",)}}

print(
    "estimator          k_T        f_m before [%]  f_c before [%]  f_m after [%]   alarms, correct"
)
for name, known in k_T_known.items():
    for label, options in (("estimated", {}), ("known", known)):
        errors, found = [], []
        for record in records:
            make = REGISTRY[name].factory
            estimator = make(N1, scenario.period, torque=record.torque, **options)
            theta = estimator.run(record.torque, record.speed)
            f_m, f_c = (theta[:, estimator.names.index(n)] for n in ("f_m", "f_c"))
            before, after = slice(1000, 2000), slice(-200, None)
            means = f_m[before].mean(), f_c[before].mean(), f_m[after].mean()
            errors.append(100 * (np.array(means) / [0.05, 0.1, 0.075] - 1))
            names = [finding.parameters for finding in getattr(estimator, "findings", ())]
            found += [named == ("f_m",) for named in names]
        pairs = zip(np.mean(errors, axis=0), np.std(errors, axis=0), strict=True)
        cells = [f"{mean:.2f} ± {deviation:.2f}" for mean, deviation in pairs]
        print(f"{name:18} {label:10}", *(f"{c:15}" for c in cells), f"{len(found)}, {sum(found)}")
