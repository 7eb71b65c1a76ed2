"""Simulation of the axis; the modules of this package use the true parameters.

`scenario` defines a run, `simulate` simulates a scenario for a batch of seeds, and `record` defines
the result: measured torque and motion, and the true values. `tables` defines the tables of a
scenario, `conflicts` checks a scenario, `plant` contains the MuJoCo model and the control loop, and
`files` reads and writes files. This package imports no estimator.
"""
