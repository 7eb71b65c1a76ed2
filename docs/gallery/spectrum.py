"""
Where the information is: spectrum of the torque, and how strongly it moves each prediction
===========================================================================================

The gradient ψ of the predictor is a filtered torque. Half of what is known of the arm comes from
around the lower mode, in which the arm swings.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexaxis as fx
from flexaxis.estimators import three_mass
from flexaxis.estimators.offline.predictor import predict

record = fx.simulate("paper_nominal-v1", seed=0, duration=20.0)
names = ("k_T", "1/J_a", "f_m")
model = three_mass(record.definition.nominal.as_dict()).parametrize(names)
psi = predict(model, model.theta, record.torque, period=0.005)[1][-2000:]
omega = 2 * np.pi * np.fft.rfftfreq(2000, 0.005)

for name, signal in zip(names, psi.T, strict=True):
    power = np.abs(np.fft.rfft(signal)) ** 2
    plt.semilogy(omega[1:301], power[1:301] / power.sum(), label=name)
plt.xlabel("frequency [rad/s]")
plt.ylabel("share of the power of ψ")
plt.legend()
