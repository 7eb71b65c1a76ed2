"""Simulate the flexible axis in closed loop with its true parameters.

The module `scenario` defines a run, and the module `simulate` runs a scenario for a batch of seeds.
A simulation returns a `record` with the logged torque, the measured motion, the true motion and the
true parameters. The package `tables` defines the tables of a scenario, and the module `conflicts`
checks a scenario. The package `plant` contains the MuJoCo model and the control loop. The module
`text_files` reads and writes files. No module of this package imports an estimator.
"""
