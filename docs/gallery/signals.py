"""
What an estimator sees: the torque, and the motor speed with its noise
======================================================================
"""

import flexaxis as fx

record = fx.simulate("fm_step-v1", seed=0, duration=12.0)
record.plot("torque", "speed", "true_speed")
