"""
Regularisation limits the windup of P during a standstill
=========================================================

From 10 to 30 s the axis is at rest, and forgetting divides $P$ by λ in every sample. If $P$ had no
limit, the first measurements after the standstill could change the estimates by any amount. The
regularisation μ limits $P$ to (1 − λ)/μ. Without regularisation, only the option `ceiling` of the
filter limits $P$.
"""

import matplotlib.pyplot as plt

import flexaxis as fx
from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P

record = fx.simulate("pause_fm_step-v1", seed=0)
model = three_mass(record.definition.nominal.as_dict())
names = ("k_T", "1/J_a", "f_m")
for mu in (0.0, 1e-3, 1e-1):
    P0 = known_P(names, forgetting=0.995)
    rpem = Rpem(model, identify=names, P0=P0, forgetting=0.995, regularization=mu, period=0.005)
    P = rpem.trace(record.torque, record.speed).P
    plt.semilogy(record.time, P[:, 0, 0], label=f"μ = {mu:g}")
    if mu > 0:
        plt.axhline(0.005 / mu, color="grey", linewidth=0.8, linestyle=":")
plt.axvspan(10, 30, color="tab:orange", alpha=0.1)
plt.xlabel("time [s]")
plt.ylabel("$P$ of $k_T$")
plt.legend()
