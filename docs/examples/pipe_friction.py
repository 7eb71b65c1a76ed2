"""Estimate the motor friction f_m in a separate program that communicates through a pipe.

The estimator name in flexaxis is `pipe:python docs/examples/pipe_friction.py`. The program predicts
the motor speed, and computes the sensitivity of the predicted speed to f_m. The program does not
import flexaxis, but uses its binary pipe protocol. The command `flexaxis new` writes similar
programs in C and Octave.
"""

import struct
import sys

import numpy as np
from scipy.linalg import expm

take, give = sys.stdin.buffer.read, sys.stdout.buffer.write


def name():
    """Read a zero-padded 32-byte name from standard input."""
    return take(32).rstrip(b"\0").decode()


# The header contains the period and the nominal values. The answer contains the kind of output and
# the names of the estimated parameters.
take(16)  # skip FLEXAXIS, version and byte order
T, output, values, names = struct.unpack("<dIII", take(20))
n = {name(): struct.unpack("<d", take(8))[0] for _ in range(values)}
take(32 * names)  # skip the names of the parameters to identify
give(struct.pack("<8sIIII32s", b"FLEXAXIS", 1, 0x01020304, 1, 0, b"f_m"))
sys.stdout.flush()  # otherwise the answer would remain in a buffer

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
X = np.zeros(11)  # sensitivity of x, then x, then the input

while count := take(8):
    samples = np.frombuffer(take(16 * struct.unpack("<Q", count)[0]), "<f8").reshape(-1, 2)
    for u, y in samples:
        M = np.zeros((11, 11))
        M[:5, :5] = M[5:10, 5:10] = A + theta * dA
        M[:5, 5:10], M[5:10, 10] = dA, B
        X = expm(M * T) @ X
        X[10] = u  # u acts from now on
        if not np.isnan(y):  # y is NaN in a gap
            psi = X[2]
            gain = P * psi / (1 + psi * P * psi)
            theta = min(max(theta + gain * (y - X[7]), low), high)
            P = (1 - gain * psi) * P / forgetting
        give(struct.pack("<d", theta))
    sys.stdout.flush()
