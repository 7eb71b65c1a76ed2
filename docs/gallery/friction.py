"""
Viscous or dry: a linear model takes dry friction for viscous, one with both does not
=====================================================================================

Beside 0.1 N m of Coulomb friction, $f_m$ of the linear estimator is a third too high before
anything has happened.
"""

import flexaxis as fx

record = fx.simulate("coulomb_fm_step-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot("f_m", band=False)
fx.estimate(record, "glr").plot("f_m", ax=axes, band=False)
