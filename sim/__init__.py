"""Ground truth: everything that knows the true parameters of the axis.

`scenario` defines a run, `simulate` runs it for a batch of seeds, `record` holds the result.
In come a scenario and seeds; out go records: torque and motion as measured, and the truth beside
them. `tables` holds the parts of a scenario, `conflicts` checks them, `plant` holds MuJoCo and the
loop, `files` reads and writes. Nothing here imports an estimator.
"""
