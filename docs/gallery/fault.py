"""
Two estimators after a fault: motor friction rises by 50 % at 10 s
==================================================================

The method with a forgetting factor adapts all parameters with a memory of one second. `glr`
determines which parameter jumped and when, and changes only the estimate of this parameter. The
bands (±2σ) show the standard deviations that the estimators report.
"""

import flexaxis as fx

record = fx.simulate("fm_step-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot()
fx.estimate(record, "glr").plot("k_T", "1/J_a", "f_m", ax=axes)
