"""
Lag as a function of the fault size in a study with nine runs
=============================================================
"""

import flexaxis as fx

results = fx.study(
    {
        "scenario": "fm_step-v1",
        "estimators": ["rpem-forgetting"],
        "seeds": 3,
        "sweep": {"fault[0].factor": [1.2, 1.5, 2.5]},
    }
)
results.plot("fault[0].factor")
