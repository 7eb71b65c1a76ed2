"""Standstill: without regularisation P winds up, and the restart bursts.

From 10 to 30 s nothing excites the axis; the fault comes at 20 s, in the middle of the pause. The
regularisation μ holds P, and with it the estimate.
"""

import flexaxis as fx

record = fx.simulate("pause_fm_step-v1", seed=0)
for regularization in (0, 1e-4, 1e-2):
    name = f"rpem-forgetting[regularization={regularization}]"
    found = fx.estimate(record, name)
    axes = found.plot("f_m", ax=None if regularization == 0 else axes, band=False)
axes.set_ylim(0, 0.15)
