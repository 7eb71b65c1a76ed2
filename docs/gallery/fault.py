"""
A fault and two estimators: motor friction jumps by half at 10 s
================================================================

The method with a forgetting factor needs its memory of a second; `glr` weighs which parameter
jumped, and when, and moves that one. The band is ±2σ as claimed.
"""

import flexaxis as fx

record = fx.simulate("fm_step-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot()
fx.estimate(record, "glr").plot("k_T", "1/J_a", "f_m", ax=axes)
