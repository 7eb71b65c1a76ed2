"""Ground truth: everything that knows the true parameters of the axis.

`scenario` says what a run is, `simulate` runs it for a batch of seeds, `record` is what comes out.
In come a scenario and seeds; out go records: torque and motion as measured, and the truth beside
them. `tables` holds what a scenario is made of, `plant` MuJoCo and the loop, `storage` all files.
Nothing here imports an estimator.
"""
