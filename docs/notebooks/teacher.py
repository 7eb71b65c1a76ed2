# %% [markdown]
# # A lesson: forgetting
#
# In this 45-minute lesson, students close the control loop of a flexible axis, identify the axis while the loop runs, inject a
# fault, and learn how a forgetting factor trades noise for speed. Questions are in *italics*, and the answers are at the end.
#
# Students need to know the method of least squares. `flexaxis demo` shows the same axis interactively, and
# [labs](../labs/README.md) 3 to 5 treat forgetting in more detail.

# %%
import matplotlib.pyplot as plt
import numpy as np

import flexaxis as fx
from flexaxis.estimators import Rpem, three_mass

plt.rcParams["figure.dpi"] = 90

# %% [markdown]
# ## 1. Close the loop
#
# `fx.make_axis` returns an axis in MuJoCo without a controller. `axis.step(torque)` applies a constant torque for 5 ms and
# returns the sensor readings. Two springs couple the motor, the gear and the arm:
#
# $$ J_m \dot v_m = k_T u - f_m v_m - r\tau_g, \qquad J_g \dot v_g = \tau_g - \tau_a - f_g v_g, \qquad J_a \dot v_a = \tau_a - f_a v_a. $$
#
# A PI controller, which is only three lines of code, controls the motor speed. The reference is a sum of sines, because
# identification needs a motion that excites the axis.


# %%
def reference(t):
    """Return the desired motor speed [rad/s] at the time t [s]."""
    return sum(
        2.2 * np.sin(2 * np.pi * f * t + f**2) for f in (0.3, 1.1, 2.3, 5.9, 11.3, 15.7, 16.3, 24.1)
    )


def close_the_loop(axis, *, Kp=0.1, Ki=0.4):
    """Run the control loop, and return the torque (N,) [N m] and the speed (N,) [rad/s]."""
    torque, speed, integral = [], [], 0.0
    while True:
        e = reference(axis.sample.time) - axis.sample.speed
        integral += Ki * 0.005 * e
        torque.append(Kp * e + integral)
        speed.append(axis.sample.speed)
        if axis.done:
            return np.array(torque), np.array(speed)
        axis.step(torque[-1])


axis = fx.make_axis("fm_step-v1", seed=1)  # the motor friction f_m rises by 50 % at 10 s
u, y = close_the_loop(axis)
t = 0.005 * np.arange(len(u))

figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 3.6), layout="constrained")
above.plot(t, reference(t), "k--", lw=1, label="reference")
above.plot(t, y, lw=0.9, label="measured")
below.plot(t, u, color="#D55E00", lw=0.9)
above.set(ylabel="motor speed [rad/s]", xlim=(8, 12))
below.set(ylabel="torque [N m]", xlabel="time [s]")
above.axvline(10, color="k", lw=0.8)
below.axvline(10, color="k", lw=0.8)
above.legend(frameon=False, ncols=2, loc="lower left")
plt.show()
# %% [markdown]
# *Question 1. At the vertical line the motor friction rises by 50 %. How could you see the fault in the signals without the
# line?*
# ## 2. Identify the axis while the loop runs
#
# In every sample, the recursive prediction-error method compares the measured speed with the prediction of a model. It then
# changes the parameters in the direction that reduces the prediction error. With the gradient ψ of the prediction and the
# forgetting factor λ,
#
# $$ \varepsilon = y - \hat y,\qquad K = \frac{P\psi}{1+\psi^\mathsf{T}P\psi},\qquad
#    \hat\theta \leftarrow \hat\theta + K\varepsilon,\qquad P\leftarrow \frac{(I-K\psi^\mathsf{T})P}{\lambda}. $$

# %%
names = ("k_T", "1/J_a", "f_m")
model = three_mass(fx.make_axis("fm_step-v1").scenario.nominal.as_dict())


def identified(u, y, forgetting):
    """Return the parameter estimates (N, 3), divided by the nominal values."""
    P0 = np.diag([2.97e-4, 5.19e-5, 4.69e-6]) * (1 - forgetting) / 0.005
    rpem = Rpem(model, identify=names, P0=P0, forgetting=forgetting, period=0.005)
    return rpem.run(u, y) / model.parametrize(names).theta


figure, panels = plt.subplots(3, 1, sharex=True, figsize=(8, 5), layout="constrained")
for forgetting, colour in ((0.98, "#D55E00"), (0.995, "#0072B2"), (0.999, "#009E73")):
    theta = identified(u, y, forgetting)
    for ax, column in zip(panels, theta.T, strict=True):
        ax.plot(t, column, color=colour, lw=1, label=f"λ = {forgetting}")
for ax, label, true in zip(
    panels, ("$k_T$", "$1/J_a$", "$f_m$"), ((1, 1), (1, 1), (1, 1.5)), strict=True
):
    ax.step([0, 10, 20], [true[0], true[0], true[1]], "k--", lw=1, where="pre")
    ax.set_ylabel(f"{label} / nominal")
    ax.grid(alpha=0.25)
    ax.set_xlim(2, 20)
panels[0].legend(frameon=False, ncols=3)
panels[2].set_xlabel("time [s]")
plt.show()
# %% [markdown]
# *Question 2. Which λ would you choose for an axis that wears over months? Which λ would you choose for an axis with a load that
# may change suddenly?*
#
# *Question 3. Why does the estimate of $k_T$ change although only $f_m$ has changed?*
#
# ## 3. The trade-off in theory and experiment
#
# The memory is $1/(1-\lambda)$ samples. A filter with a longer memory averages out more noise, but reacts later to a change. For
# small $\nu = 1-\lambda$ the theory (Ljung and Gunnarsson, 1990) predicts
#
# $$ \operatorname{var}\hat\theta = \tfrac12\,\nu\,\sigma^2 Q^{-1},\qquad Q = \mathrm E\,\psi\psi^\mathsf{T},
#    \qquad\text{lag} \approx T/\nu. $$

# %%
lambdas = 1 - np.array([0.02, 0.01, 0.005, 0.0025, 0.00125])
texts = [f"rpem-forgetting[forgetting={value:.5g}]" for value in lambdas]
results = fx.benchmark(texts, scenarios="fm_step-v1", seeds=12)
rows = results.scores().query("parameter == 'f_m'").set_index("estimator").to_dict("index")
nu = 1 - lambdas
std, lag = (np.array([rows[text][score] for text in texts]) for score in ("std", "lag"))

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
left.loglog(nu, std, "o", label="measured")
left.loglog(nu, std[2] * np.sqrt(nu / nu[2]), "k--", lw=1, label="$\\propto\\sqrt{\\nu}$")
left.set(xlabel="ν = 1 − λ", ylabel="std of $f_m$ [%]")
right.loglog(nu, lag, "o", color="#D55E00", label="measured")
right.loglog(nu, 0.005 / nu, "k--", lw=1, label="$T/\\nu$")
right.set(xlabel="ν = 1 − λ", ylabel="lag [s]")
for ax, ticks in ((left, (0.2, 0.4, 0.8)), (right, (0.3, 1, 3))):
    ax.set_xticks(nu, [f"{100 * value:g} %" for value in nu])
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.legend(frameon=False)
    ax.grid(alpha=0.25)
plt.show()

# %%
slope = np.polyfit(np.log(nu), np.log(std), 1)[0]
print(f"check: the std is proportional to ν to the power {slope:.2f}, and the theory predicts 0.5")
assert 0.4 < slope < 0.65

# %% [markdown]
# *Question 4. Where does the lag deviate from the line, and why?*
#
# ## 4. Low noise and a short lag
#
# A filter with forgetting discounts old data in the same way at all times and for all parameters. An estimator that *detects*
# changes can have little noise before a change and be fast after the change:

# %%
record = fx.simulate("fm_step-v1", seed=1)
axes = fx.estimate(record, "rpem-forgetting").plot("f_m", band=False)
fx.estimate(record, "glr").plot("f_m", ax=axes, band=False)
axes.set_xlim(8, 16)
axes.figure.set_size_inches(8, 3)
plt.show()

# %% [markdown]
# ## Answers
#
# 1. You cannot see the fault in the signals: the controller compensates for the fault, and the torque rises only by a few per
#    cent at some frequencies. Only an estimator can detect a change that the controller hides.
# 2. For slow wear, choose λ near one, because low noise is most important. For a sudden change of the load, choose a small λ or
#    an estimator that detects changes (section 4).
# 3. The estimates of $k_T$ and $f_m$ are correlated. Both parameters can explain part of the missing torque until there are
#    enough samples to separate them.
# 4. The lag deviates from the line at both ends. With a long memory, the window of 5 s after the fault is too short, and the run
#    ends before the estimate has converged. With a very short memory, the filter adapts as fast as the transients of the axis
#    decay, and the theory does not apply.
#
# - L. Ljung and S. Gunnarsson, *Adaptation and tracking in system identification: a survey*, Automatica 26 (1990), 7–21.
# - L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall, 1999, chapter 11.
