"""Standstill: without regularisation P winds up, and the restart bursts.

From 10 to 30 s nothing excites the axis; the fault comes at 20 s, in the middle of the pause. The
regularisation μ holds P, and with it the estimate.
"""

import flexaxis as fx

record = fx.simulate("pause_fm_step-v1", seed=0)
axes = None
for regularization in (0, 1e-4, 1e-2):
    found = fx.estimate(record, f"rpem-forgetting[regularization={regularization}]")
    axes = found.plot("f_m", ax=axes, band=False)
axes.set_ylim(0, 0.15)
