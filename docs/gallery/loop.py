"""
A control loop in Python, with a fault at 10 s
==============================================
"""

import matplotlib.pyplot as plt

import flexaxis as fx

axis = fx.make_axis("fm_step-v1", duration=12.0)
time, speed = [], []
while not axis.done:
    wanted = 5.0 if axis.sample.time % 4 < 2 else -5.0
    sample = axis.step(0.2 * (wanted - axis.sample.speed))
    time.append(sample.time)
    speed.append(sample.speed)

plt.plot(time, speed)
plt.axvline(10, color="grey", linewidth=0.8)
plt.xlabel("time [s]")
plt.ylabel("motor speed [rad/s]")
