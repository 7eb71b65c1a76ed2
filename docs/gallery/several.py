"""
Three faults in a row, and what an estimator says it found
==========================================================
"""

import flexaxis as fx

record = fx.simulate("three_faults-v1", seed=0)
found = fx.estimate(record, "glr")
axes = found.plot()
for finding in found.findings:
    for ax in axes:
        ax.axvline(0.005 * finding.alarm, color="tab:red", linewidth=0.8, linestyle=":")
