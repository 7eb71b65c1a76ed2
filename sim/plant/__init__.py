"""The axis in MuJoCo and the control loop around it.

The modules here simulate a batch of runs sample by sample: they take the parameters and nonlinear
laws of a scenario and return angles, speeds and torques.
"""
