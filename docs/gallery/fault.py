"""A fault and two estimators: motor friction jumps by half at 10 s.

The method with a forgetting factor needs its memory of a second; `relocate` detects the jump, goes
back to when it happened and refits the one parameter that explains it. The band is ±2σ as claimed.
"""

import flexaxis as fx

record = fx.simulate("fm_step-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot()
fx.estimate(record, "relocate").plot(ax=axes)
