"""Ground truth: everything that knows the true parameters of the axis.

`scenario` defines a run, `simulate` runs it for a batch of seeds, and `record` holds the result:
measured torque and motion, and the true values. `tables` holds the parts of a scenario, `conflicts`
checks them, `plant` contains the MuJoCo model and the control loop, and `files` reads and writes
files. This package imports no estimator.
"""
