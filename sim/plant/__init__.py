"""Simulate the axis in MuJoCo together with its control loop.

The modules of this package simulate several runs in parallel, sample by sample. The parameters and
nonlinear effects of a scenario determine the simulated angles, speeds and torques.
"""
