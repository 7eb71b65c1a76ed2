"""Simulate the axis in MuJoCo and the control loop around the axis.

The modules in this package simulate a batch of runs sample by sample. The simulation uses the
parameters and the nonlinear laws of a scenario to compute angles, speeds and torques.
"""
