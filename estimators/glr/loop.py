"""The sample loop of the estimator glr, which filters new samples and re-filters old samples."""

import numpy as np

from flexaxis.estimators.filters.constrained import draw_estimates
from flexaxis.estimators.filters.joint import Joint, look, predict, update
from flexaxis.estimators.filters.noise import judge, learn_torque_noise, show
from flexaxis.estimators.glr.bank import ALARM, NEVER, correct, mean_of, open_slots, weigh
from flexaxis.estimators.glr.bank_arrays import BUDGET, Bank
from flexaxis.estimators.glr.cogging import (
    begin_sums,
    begin_waves,
    carry_waves,
    look_for_waves,
)
from flexaxis.estimators.models.compiler import inlined, loop
from flexaxis.estimators.models.matrix_rows import multiply
from flexaxis.estimators.models.memory import views
from flexaxis.estimators.models.series import LAWS

LEARNS = (0.02, 0.003)  # rates of `learn_torque_noise` during and after initialisation
LOWEST = np.exp(-11.0)  # smallest variance of the torque noise relative to the initial variance,
# which limits the standard deviation to 0.12 % of the rms torque. LEARNS and LOWEST were tuned on
# seeds 4-23 of encoder_fm_step and coarse_encoder_fm_step. With a limit of 0.55 %, the lag on the
# finer encoder was a fifth longer


@loop
def glr(blocks, at, bank_block, bank_at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """
    Process new samples until a decision is due, and return the number of processed samples.

    ``blocks`` holds the arrays of two filters, each of which estimates the parameters and the
    state. The second filter processes old samples again, at most `BUDGET` old samples for each new
    sample. The field ``left`` of the hypothesis bank is the number of old samples that the second
    filter can still process before the next new sample.
    """
    state, second = views(Joint, blocks[0], at), views(Joint, blocks[1], at)
    bank = views(Bank, bank_block, bank_at)
    b = bank.now[0]
    if b["left"] > 0:
        _go_through(second, bank, state.now[0])
        if b["busy"] > 0 and b["at"] >= b["end"]:
            return 0
    for k in range(len(u)):
        b["left"] = BUDGET
        _measure(state, bank, u[k], y[k], valid[k])
        asks = _think(state, bank, estimates[k])
        show(state.now[0], trace[k])
        predict(state, u[k], LAWS)
        if b["searching"] > 0:
            look_for_waves(b, bank.waves.pull, state.now[0], state.axis)
        _go_through(second, bank, state.now[0])
        if asks or (b["busy"] > 0 and b["at"] >= b["end"]):
            return k + 1
    return len(u)


@inlined
def _measure(state, bank, u, y, valid):
    """Check a sample for outliers, store it, and update the filter and the hypothesis bank."""
    look(state)
    now = state.now[0]
    used = judge(now, y, valid, state.X[-1, 0], now["spread"])
    kept = bank.history[bank.now[0]["taken"] % len(bank.history)]
    kept[0], kept[1], kept[2], kept[3] = u, used, now["noise"], now["torque_noise"]
    e, S = used - state.X[-1, 0], now["spread"] + now["noise"]
    update(state, used, now["noise"])
    _carry(bank, state, e, S)


@inlined
def _carry(bank, state, e, S):
    """Propagate the hypothesis columns by one sample, and update them with a measurement."""
    b, z = bank.now[0], 0.0
    if b["searching"] > 0:
        carry_waves(bank.waves, state.axis, state.G)
        z = correct(bank.waves.columns, state, e, S)
        b["repeated"] += z * b["z_before"]
        b["z_before"] = b["z_before"] if np.isnan(e) else z
    elif b["awake"] > 0:
        multiply(state.G, bank.columns.D, bank.columns.moved)
        z = correct(bank.columns, state, e, S)
    b["chi2"] += z * z
    if not np.isnan(e):
        b["used"] += 1.0


@inlined
def _go_through(state, bank, latest):
    """Process as many old samples with the second filter as the computing budget allows."""
    b = bank.now[0]
    while b["left"] > 0 and b["at"] < b["end"]:
        b["left"] -= 1
        look(state)
        kept = bank.history[b["at"] % len(bank.history)]
        used, noise, torque_noise = kept[1], kept[2], kept[3]
        if b["awake"] == 0:  # these samples came before the noise was known
            noise = min(noise, latest["noise"])
            torque_noise = np.sqrt(torque_noise * latest["torque_noise"])
        state.now[0]["torque_noise"] = torque_noise
        if b["measured"] == 0:
            e, S = used - state.X[-1, 0], state.now[0]["spread"] + noise
            update(state, used, noise)
            multiply(state.G, bank.one.D, bank.one.moved)
            z = correct(bank.one, state, e, S)
            b["chi2_one"] += z * z
            if not np.isnan(used):
                b["cost_one"] += z * z + np.log(S)
        b["at"] += 1
        b["measured"] = 0
        b["rerun"] += 1
        if b["at"] == b["mark"]:
            b["cost_first"] = b["cost_one"]
        predict(state, kept[0], LAWS)


@inlined
def _think(state, bank, estimates):
    """Compute the hypothesis weights and the estimate; return whether a decision is due."""
    b, mixed = bank.now[0], bank.mixed
    now = b["taken"]
    b["taken"] = now + 1
    if b["end_follows"] > 0:
        b["end"] = now + 1
    learn_torque_noise(state.now[0], LEARNS[int(b["awake"])], LOWEST)
    asks = (b["busy"] == 0 and 0 <= b["due"] <= now) or state.now[0]["anew"] > 0.0
    if b["awake"] > 0:
        _follow_misfit(b, state.now[0])
        open_slots(bank, state, now)
        if weigh(bank, now) > ALARM and b["busy"] == 0 and now >= b["patience"]:
            asks = True
        mean_of(bank, state.theta, state.lower, state.upper)
    else:
        if b["busy"] == 0:
            asks = asks or _has_moved(b, bank.waves, state.now[0], now)
        for a in range(len(mixed)):
            mixed[a] = state.theta[a]
    draw_estimates(bank.told, state.P, mixed, estimates)
    b["asks"] = 1 if asks else 0
    return asks


@inlined
def _has_moved(b, waves, s, now):
    """Return whether the axis has moved long enough to learn the structure of the axis."""
    long = b["commissioning"]
    step = s["prediction"] - s["counts"] * b["last_prediction"]  # for an angle, its change
    b["last_prediction"] = s["prediction"]
    if step**2 > s["noise"] > 0.0:
        b["moves"] += 1
        if b["searching"] > 0 and b["moves"] == long // 2:
            begin_sums(b, waves)
        if b["born"] < 0:
            b["born"] = now
            if b["searching"] > 0:
                begin_waves(b, waves)
    late = b["born"] >= 0 and now - b["born"] >= 3 * long // 2
    if late and b["moves"] < long // 2:  # only noise, or too little motion
        b["born"], b["moves"], late = NEVER, 0, False
    return late or b["moves"] >= long


@inlined
def _follow_misfit(b, s):
    """
    Update the lower limit of the misfit κ: the running mean of e²/S, times (1+ρ)/(1−ρ).

    A wrong model increases ρ, the correlation between successive innovations. If innovations are
    correlated, (1+ρ)/(1−ρ) samples contain as much information as one independent sample. The
    memory of the running mean is much longer than the time covered by the hypothesis bank.
    """
    e, S = s["innovation"], s["innovation_variance"]
    if np.isnan(e) or not S > 0.0:
        b["last"] = np.nan
        return
    z = min(max(e / np.sqrt(S), -4.0), 4.0)
    share = b["misfit_share"]
    b["square"] += share * (z * z - b["square"])
    if not np.isnan(b["last"]):
        b["product"] += share * (z * b["last"] - b["product"])
    b["last"] = z
    rho = min(max(b["product"] / b["square"], 0.0), 0.95)
    b["misfit"] = max(1.0, b["square"] * (1.0 + rho) / (1.0 - rho))
