"""Ground truth: everything that knows the true parameters of the axis.

`scenario` defines a run, `simulate` runs it for a batch of seeds, and `record` holds the result:
measured torque and motion, and the true values. `tables` holds the parts of a scenario, `conflicts`
checks them, `plant` holds MuJoCo and the loop, `files` reads and writes. Nothing here imports an
estimator.
"""
