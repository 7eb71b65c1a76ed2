"""The axis in MuJoCo, and the loop around it.

In come parameters and laws of a scenario's tables, out go angles, speeds and torques of a batch of
runs, sample by sample.
"""
