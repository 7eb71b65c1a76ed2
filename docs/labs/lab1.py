"""Lab 1: the model, the poles, and a comparison of the simulated axis with the equations."""

# %% The equations
# The axis consists of three masses and two springs. The states of the axis are two twists and three
# speeds. Write down A and B before you continue (equations 3 and 4 of the paper). `r` is the gear
# ratio.
import matplotlib.pyplot as plt
import mujoco
import numpy as np
from scipy.linalg import expm

from flexaxis.models_mjcf import model_files
from flexaxis.sim.parameters import preset
from flexaxis.sim.plant.plant import Plant

axis = preset("n1")
r, k_T = axis.r, axis.k_T
J_m, J_g, J_a = axis.J_m, axis.J_g, axis.J_a
k_g, k_a, d_g, d_a = axis.k_g, axis.k_a, axis.d_g, axis.d_a
f_m, f_g, f_a = axis.f_m, axis.f_g, axis.f_a

A = np.array(
    [
        [0, 0, r, -1, 0],
        [0, 0, 0, 1, -1],
        [-r * k_g / J_m, 0, -(r**2 * d_g + f_m) / J_m, r * d_g / J_m, 0],
        [k_g / J_g, -k_a / J_g, r * d_g / J_g, -(f_g + d_g + d_a) / J_g, d_a / J_g],
        [0, k_a / J_a, 0, d_a / J_a, -(d_a + f_a) / J_a],
    ]
)
B = np.array([0, 0, k_T / J_m, 0, 0])

# %% The poles
# There are two pairs of complex poles and one real pole.
# Question 1: what is the decay time constant of each mode?
poles = np.linalg.eigvals(A)
for pole in sorted(poles, key=abs):
    print(f"{pole:24.2f}   |pole| {abs(pole):6.1f} rad/s   time constant {-1 / pole.real:.3f} s")

# %% The same matrix from MuJoCo
# The MuJoCo model consists of bodies, joints and tendons and does not use A. The following code
# sets each state to 1 in turn, and computes the accelerations.
model = mujoco.MjModel.from_xml_string(model_files("three_mass")[0])
data = mujoco.MjData(model)


def accelerations(twist_g, twist_a, speeds, torque):
    """Return the accelerations of the three masses for given twists, speeds and torque.

    The accelerations are an array (3,).
    """
    phi_a = 0.0
    phi_g = phi_a + twist_a
    phi_m = (phi_g + twist_g) / r
    data.qpos[:], data.qvel[:], data.ctrl[:] = [phi_m, phi_g, phi_a], speeds, torque
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


unit = np.eye(6)
columns = [accelerations(s[0], s[1], s[2:5], s[5]) for s in unit]
engine = np.column_stack(columns)  # rows: accelerations; columns: x1 … x5, u
equations = np.column_stack([A[2:], B[2:]])
difference = np.abs(engine - equations).max() / np.abs(equations).max()
print(f"largest relative difference between MuJoCo and the matrices A and B: {difference:.1e}")

# %% The same motion
# The torque is constant within each 5 ms sample. The exact solution needs only one matrix
# exponential, while MuJoCo computes five Runge–Kutta steps per sample.
# Question 2: why does `expm` give the exact solution, and when would this solution not be exact?
rng = np.random.default_rng(1)
torque = np.repeat(rng.standard_normal(100), 20)
held = np.zeros((6, 6))
held[:5, :5], held[:5, 5] = A, B
transition = expm(held * 0.005)
plant, x = Plant([axis], period=0.005, substeps=5), np.zeros(5)
exact, simulated = np.empty((2, len(torque)))
for k, u in enumerate(torque):
    exact[k], simulated[k] = x[2], plant.speed_m[0]
    x = transition[:5, :5] @ x + transition[:5, 5] * u
    plant.step(np.array([u]))
deviation = np.sqrt(np.mean((simulated - exact) ** 2) / np.mean(exact**2))

plt.plot(exact[:400], label="exact")
plt.plot(simulated[:400], "--", label="MuJoCo")
plt.xlabel("sample of 5 ms")
plt.ylabel("motor speed [rad/s]")
plt.legend()
plt.show()

# %% Check
lower_mode = sorted(abs(p) for p in poles if abs(p.imag) > 1)[0]
print(f"check: lower mode at {lower_mode:.1f} rad/s, relative error of MuJoCo {deviation:.1e}")
assert difference < 1e-12, "your matrix A or B differs from the MuJoCo model"
assert abs(lower_mode - 100.2) < 0.1
assert deviation < 3e-4
