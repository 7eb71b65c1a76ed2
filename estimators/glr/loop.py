"""The loop over the samples of a filter with a bank, and of what it goes through again."""

import numpy as np

from flexaxis.estimators.filters.constrained import draw_estimates
from flexaxis.estimators.filters.joint import correct, look, start_sample
from flexaxis.estimators.filters.loop import over_sample
from flexaxis.estimators.filters.noise import judge, show
from flexaxis.estimators.glr.bank import carry_columns, mean_of, open_slots, weigh
from flexaxis.estimators.glr.cogging import begin_columns, begin_sums, look_for_waves
from flexaxis.estimators.glr.records import NEVER
from flexaxis.estimators.models.compiler import Compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import Pattern


@remembered
def glr_loop(pattern: Pattern) -> Compiled:
    """
    Return the compiled loop for models of this pattern.

    ``run(tuning, states, bank, u, y, valid, estimates, trace)`` takes samples until somebody has to
    look, and returns how many. ``states`` are two records: the filter, and one that goes through
    samples again, a stated number at a time; what a pass leaves of it, ``left``, the next one has.
    """
    over = over_sample(pattern)
    search = look_for_waves if pattern.laws else _nothing

    def run(tunings, states, banks, u, y, valid, estimates, trace):  # noqa: PLR0917
        tuning, bank = tunings[0], banks[0]
        p, asks = len(tuning["lower"]), False
        for k in range(-1 if bank["left"] > 0 else 0, len(u)):
            budget = bank["left"] if k < 0 else tuning["budget"]
            bank["left"] = budget
            for again in range(1 if k < 0 else 0, 1 + budget):
                if again > 0:
                    if bank["at"] >= bank["end"]:
                        break
                    bank["left"] -= 1
                state = states[min(again, 1)]
                look(state)
                if again == 0:
                    _remember(tuning, state, bank, u[k], y[k], valid[k])
                torque = _measure(tuning, states, bank, again, p)
                start_sample(state["X"], len(state["gain"]) - p, p)
                if again == 0:
                    asks = _think(tuning, state, bank, p, estimates[k])
                    show(state, trace[k])
                over(tuning, state, torque)
                if again == 0 and bank["searching"] > 0:
                    search(tuning, state, bank)
            if asks or (bank["busy"] > 0 and bank["at"] >= bank["end"]):
                return k + 1
        return len(u)

    return Compiled(
        run, label=f"a filter with a bank for {pattern.n} states and {pattern.p} parameters"
    )


@inlined
def _nothing(tuning, state, bank):
    """Look for no waves: a model without laws has no torque to look for."""


@inlined
def _remember(tuning, state, bank, u, y, valid):  # noqa: PLR0917
    """Judge a sample, and keep it for those who go through it again."""
    row = bank["taken"] % bank["history"].shape[0]
    history = bank["history"][row]
    used = judge(tuning, state, y, valid, state["X"][-1, 0], state["spread"])
    history[0], history[1], history[2] = u, used, state["noise"]


@inlined
def _measure(tuning, states, bank, again, p):
    """Take the filter, or what goes through samples again, through one; return its torque."""
    row = (bank["taken"] if again == 0 else bank["at"]) % bank["history"].shape[0]
    torque, used, noise = bank["history"][row]
    state = states[min(again, 1)]
    if again > 0 and bank["awake"] == 0:  # noise was not known yet when these samples came
        noise = min(noise, states[0]["noise"])
    e, S = used - state["X"][-1, 0], state["spread"] + noise
    if again == 0 or bank["first"] == 0:
        correct(tuning, state, used, noise)
        if again == 0:
            carry_columns(bank, state, e, S, p)
        else:
            _carry_one(bank, state, e, S, p)
    if again > 0:
        bank["at"] += 1
        bank["first"] = 0
        bank["rerun"] += 1
        if bank["at"] == bank["mark"]:
            bank["cost_first"] = bank["cost_one"]
    return torque


@inlined
def _think(tuning, state, bank, p, estimates):
    """Weigh the hypotheses and write the estimate; return whether somebody has to look."""
    now = bank["taken"]
    bank["taken"] = now + 1
    if bank["end_follows"] > 0:
        bank["end"] = now + 1
    mixed = bank["mixed"]
    asks = (bank["busy"] == 0 and 0 <= bank["due"] <= now) or state["anew"] > 0.0
    if bank["awake"] > 0:
        _follow_misfit(tuning, bank, state)
        open_slots(bank, state, tuning["which"], tuning["base"], now, p)
        odds = weigh(
            bank,
            tuning["which"],
            tuning["variance"],
            tuning["log_prior"],
            tuning["base"],
            now,
            bank["misfit"],
        )
        mean_of(bank, state["theta"], tuning["lower"], tuning["upper"], mixed)
        bank["odds"] = odds
        if bank["busy"] == 0 and odds > tuning["alarm"] and now >= bank["patience"]:
            asks = True
    else:
        if bank["busy"] == 0:
            asks = asks or _has_moved(tuning, state, bank, now)
        for a in range(p):
            mixed[a] = state["theta"][a]
    draw_estimates(tuning, bank, state["P"], mixed, estimates)
    bank["asks"] = 1 if asks else 0
    return asks


@inlined
def _has_moved(tuning, state, bank, now):
    """Return whether the axis has moved long enough for its structure to be learnt."""
    if state["prediction"] ** 2 > state["noise"] > 0.0:
        bank["moves"] += 1
        if bank["searching"] > 0 and bank["moves"] == tuning["first"] // 2:
            begin_sums(bank)
        if bank["born"] < 0:
            bank["born"] = now
            if bank["searching"] > 0:
                begin_columns(bank)
    long = tuning["first"]
    late = bank["born"] >= 0 and now - bank["born"] >= 3 * long // 2
    if late and bank["moves"] < long // 2:  # noise, or too little to learn from
        bank["born"], bank["moves"], late = NEVER, 0, False
    return late or bank["moves"] >= long


@inlined
def _follow_misfit(tuning, bank, state):
    """
    Learn κ: the mean of e²/S as it was before the oldest onset in the bank, times its repetition.

    Innovations of a wrong model come in rows: with the correlation ρ of successive ones, as many
    as (1+ρ)/(1−ρ) count as one.
    """
    e, S = state["innovation"], state["innovation_variance"]
    if np.isnan(e) or not S > 0.0:
        bank["last"] = np.nan
        return
    z = min(max(e / np.sqrt(S), -4.0), 4.0)
    share = tuning["misfit_share"]
    bank["square"] += share * (z * z - bank["square"])
    if not np.isnan(bank["last"]):
        bank["product"] += share * (z * bank["last"] - bank["product"])
    bank["last"] = z
    rho = min(max(bank["product"] / bank["square"], 0.0), 0.95)
    bank["misfit"] = max(1.0, bank["square"] * (1.0 + rho) / (1.0 - rho))


@inlined
def _carry_one(bank, state, e, S, p):
    """Take the δ of what is gone through again over a sample, as `bank.carry_columns` does."""
    delta, X, gain, moved = bank["delta"], state["X"], state["gain"], bank["moved_one"]
    m = len(delta)
    measured = not np.isnan(e)
    root = 1.0 / np.sqrt(S) if measured else 0.0
    phi = 0.0
    for a in range(m):
        phi += X[-1, 1 + a] * root * delta[a]
    for i in range(m - p):
        moved[i] = 0.0
        for a in range(m):
            moved[i] += X[i, 1 + a] * delta[a]
    for i in range(m - p):
        delta[p + i] = moved[i]
    if measured:
        z = e * root
        bank["J_one"] += phi * phi
        bank["d_one"] += phi * z
        bank["chi2_one"] += z * z
        bank["cost_one"] += z * z + np.log(S)
        for a in range(m):
            delta[a] -= gain[a] * phi
