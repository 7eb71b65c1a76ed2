"""A flexaxis estimator as a program of its own: `pipe:python docs/examples/pipe_friction.py`.

It estimates the motor friction f_m with a predictor of the axis and its sensitivity to f_m. It
knows nothing of flexaxis but the lines of JSON; pipe_friction.m is the same in GNU Octave.
"""

import json
import sys

import numpy as np
from scipy.linalg import expm


def answer(content):
    """Send one line; without the flush it would wait in a buffer for ever."""
    print(json.dumps(content), flush=True)


# The first line says what there is to know; the answer says what is estimated, from which output.
header = json.loads(sys.stdin.readline())
T, n = header["period"], header["nominal"]
answer({"names": ["f_m"], "output": "speed"})

# x = [twist motor-gear, twist gear-arm, speeds of motor, gear and arm]
r = n["r"]
A = np.array([
    [0, 0, r, -1, 0],
    [0, 0, 0, 1, -1],
    np.array([-r * n["k_g"], 0, -(r**2) * n["d_g"], r * n["d_g"], 0]) / n["J_m"],
    np.array([n["k_g"], -n["k_a"], r * n["d_g"], -n["f_g"] - n["d_g"] - n["d_a"], n["d_a"]])
    / n["J_g"],
    np.array([0, n["k_a"], 0, n["d_a"], -n["d_a"] - n["f_a"]]) / n["J_a"],
])  # fmt: skip
B = np.array([0, 0, n["k_T"] / n["J_m"], 0, 0])
dA = np.zeros((5, 5))  # derivative of A with respect to f_m
dA[2, 2] = -1 / n["J_m"]

theta, forgetting = n["f_m"], 0.995
low, high = 0.1 * theta, 10 * theta
P = 1e-3 * (1 - forgetting)
X = np.zeros(11)  # sensitivity of x, x, and the input that is held

for line in sys.stdin:
    sample = json.loads(line)
    M = np.zeros((11, 11))
    M[:5, :5] = M[5:10, 5:10] = A + theta * dA
    M[:5, 5:10], M[5:10, 10] = dA, B
    X = expm(M * T) @ X
    X[10] = sample["u"]  # acts from now on
    if sample["y"] is not None:  # it is null in a gap
        psi = X[2]
        gain = P * psi / (1 + psi * P * psi)
        theta = min(max(theta + gain * (sample["y"] - X[7]), low), high)
        P = (1 - gain * psi) * P / forgetting
    answer({"theta": [theta]})
