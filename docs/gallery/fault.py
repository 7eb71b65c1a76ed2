"""
Two estimators after a 50 % increase in motor friction at 10 s
==============================================================

The method with a forgetting factor adapts all parameters with a memory of one second. The estimator
`glr` determines which parameter jumped, and changes only the estimate of that parameter. The bands
are the ±2σ intervals that the estimators report.
"""

import flexaxis as fx

record = fx.simulate("fm_step-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot()
fx.estimate(record, "glr").plot("k_T", "1/J_a", "f_m", ax=axes)
