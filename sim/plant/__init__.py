"""The axis in MuJoCo and the control loop around it.

The modules in this package simulate a batch of runs sample by sample. They take the parameters and
nonlinear laws of a scenario, and compute angles, speeds and torques.
"""
