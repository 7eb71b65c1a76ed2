"""How often a good log is said to be unlike the others of its axis, and how often a bad one is.

    python tests/experiments/log_health_tables.py --seeds 6100:6103

Sets of 20 logs of one and two masses, of which friction scatters by 1 % and falls by 10 % over the
set, at several rates, lengths and levels of noise; then with the last log of each set spoilt. The
axis is known to 3 %, and what is estimated is what the first log tells to 10 %, as by default.
"""

import argparse
from dataclasses import replace

import numpy as np
from identify_axes import NAMES, VALUES
from scipy.signal import cont2discrete, dlsim

from flexaxis.estimators.models.axes import MODELS
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.trend.estimates import estimated
from flexaxis.experiments.logs.trend.refit import seen
from flexaxis.experiments.logs.trend.trend import ailments
from flexaxis.sim.record import Record

LOGS = 20
SETS = [
    (masses, rate, seconds, noise)
    for masses in (1, 2)
    for rate in (200.0, 1000.0, 4000.0)
    for seconds, noise in ((3.0, 0.02), (3.0, 0.3), (12.0, 0.02), (12.0, 0.3))
    if rate * seconds <= 20_000
]


def record_of(masses, rate, seconds, noise, *, friction, seed, dry=0.0):
    """Return a log with a held torque, exact but for dry friction: that of the sample before."""
    values = VALUES[masses] | {"f_m": VALUES[masses]["f_m"] * friction}
    model = MODELS[NAMES[masses]].factory(values)
    whole = model.parametrize(model.parameters)
    A, B, C = whole.matrices(whole.theta)
    N, T = round(rate * seconds), 1 / rate
    rng = np.random.default_rng(seed)
    wide = rng.standard_normal((N // max(round(rate / 100), 1) + 1, 1))  # of 50 Hz
    u = np.repeat(wide, max(round(rate / 100), 1), axis=0)[:N]
    Ad, Bd, Cd, Dd, _ = cont2discrete((A, B.reshape(-1, 1), np.atleast_2d(C), [[0.0]]), T)
    if dry:
        x, y = np.zeros(len(A)), np.zeros(N)
        for k in range(N):
            y[k] = (Cd @ x)[0]
            x = Ad @ x + Bd[:, 0] * (u[k, 0] - dry * np.sign(y[k]))
    else:
        y = dlsim((Ad, Bd, Cd, Dd, T), u)[1][:, 0]
    noisy = y + noise * np.std(y) * rng.standard_normal(N)
    return Record(time=T * np.arange(N), torque=u[:, 0], speed=noisy)


def _late(record):
    """Return a log of which the torque is logged half a sample late: the mean of two."""
    u = record.torque
    return replace(record, torque=(u + np.append(u[1:], u[-1])) / 2)


def _shaken(record):
    speed = record.speed + 0.15 * np.std(record.speed) * np.sin(40 * record.time)
    return replace(record, speed=speed)


SPOILT = {"half a sample": _late, "a vibration of 15 %": _shaken}


def rows_of(masses, rate, seconds, noise, seed):
    """Return the rows of a set of good logs, and those of its last one spoilt in each way."""
    rng = np.random.default_rng([seed, masses])
    values = VALUES[masses]
    off = {n: v * (1 + 0.03 * rng.uniform(-1, 1) * (n != "k_T")) for n, v in values.items()}
    axis = Axis(MODELS[NAMES[masses]].factory(off), {"model": NAMES[masses]}, known=True)
    falls = np.linspace(1.0, 0.9, LOGS) * np.exp(0.01 * rng.standard_normal(LOGS))
    setting = (masses, rate, seconds, noise)
    each = [record_of(*setting, friction=f, seed=[seed, i, masses]) for i, f in enumerate(falls)]
    dry = record_of(*setting, friction=falls[-1], seed=[seed, 99, masses], dry=0.1)
    bad = {word: spoil(each[-1]) for word, spoil in SPOILT.items()} | {"dry friction of 10 %": dry}

    names = seen(each[0], axis, [name for name in values if name != "k_T"])

    def row(name, record):
        return {"log": name, "problem": ""} | estimated(record, axis, names)

    return [row(str(i), r) for i, r in enumerate(each)], {w: row(w, r) for w, r in bad.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:1")
    first, last = map(int, parser.parse_args().seeds.split(":"))
    print("| masses | rate | length | noise | good logs said to be bad | bad ones found |")
    print("|---|---|---|---|---|---|")
    for setting in SETS:
        false, found, said = 0, {}, set()
        for seed in range(first, last):
            good, bad = rows_of(*setting, seed)
            ill = ailments(good)
            false += len(ill)
            said |= {text for texts in ill.values() for text in texts}
            for word, row in bad.items():
                found.setdefault(word, []).append(word in ailments([*good[:-1], row]))
        masses, rate, seconds, noise = setting
        words = ", ".join(f"{word} {sum(f)}/{len(f)}" for word, f in found.items())
        print(
            f"| {masses} | {rate:g} Hz | {seconds:g} s | {100 * noise:g} % | "
            f"{false}/{LOGS * (last - first)} | {words} | {'; '.join(said)}",
            flush=True,
        )


if __name__ == "__main__":
    main()
