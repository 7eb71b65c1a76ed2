"""
Probability of a jump in each parameter around a fault, computed by glr
=======================================================================
"""

import matplotlib.pyplot as plt

import flexaxis as fx
from flexaxis.experiments.running.estimators import build, parse

record = fx.simulate("fm_step", seed=0, duration=11.0)
estimator = build(parse("glr"), record.definition)
beliefs = []
for u, y in zip(record.torque, record.speed, strict=True):
    estimator.step(u, y)
    beliefs.append(dict(estimator.beliefs))

names = [name for name in beliefs[-1] if max(each.get(name, 0) for each in beliefs[1900:]) > 0.05]
curves = [[each.get(name, 0) for each in beliefs] for name in names]
plt.stackplot(record.time, curves, labels=names)
plt.xlim(9.9, 10.3)
plt.legend(loc="upper left")
plt.xlabel("time [s]; f_m +50 % at 10 s")
plt.ylabel("probability of a jump")
