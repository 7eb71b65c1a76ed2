"""
Verdict on a changed estimator in two scenarios: better, worse or undecided
===========================================================================
"""

import flexaxis as fx

verdict = fx.compare(
    "rpem-forgetting",
    "rpem-forgetting[forgetting=0.99]",
    scenarios=["fm_step-v1", "kt_step-v1"],
    seeds=12,
)
verdict.plot()
