"""
The prediction-error method in C, straight-line for one pattern: how fast the processor can do it.

``python tests/scale/floor.py [--avx2]`` prints run-samples per second of both, for 1 to 16 runs.

What `Rpem` does with a sample where a residual is clipped: eq. (5)–(9) and (20)–(23), the box, the
covariance of the estimate, the noise variance and the ceiling; no gaps, no drift, no
regularisation, and nothing that watches the sensor. For R > 1 a number of each of R runs stands in
every place; for one run the value and its derivatives stand side by side.
"""

import argparse
import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

import flexaxis as fx
from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.methods.beside import registers
from flexaxis.estimators.sampling.pattern import Pattern, split
from flexaxis.estimators.side_by_side import run_together
from flexaxis.sim.parameters import preset

CC = shutil.which("cc") or shutil.which("gcc")
FLAGS = "-O3 -march=native -ffp-contract=fast -fno-math-errno -fno-trapping-math -fopenmp-simd"
TOGETHER = 2  # lanes that go at a time, so that registers suffice; no other number is faster
HEAD = """
#include <math.h>
#include <string.h>
enum {{ R = {R}, P = {p}, N = {n}, L = {L}, E = {E}, T = {T} }};
typedef double V __attribute__((vector_size({bytes}), aligned(8)));
typedef struct {{ double {both}; }} State;
typedef struct {{ double forgetting, lower[P], upper[P], coefficient[T], weight[40], clip, memory,
    consistency, ceiling, floor[P], early[P]; int order; }} Tuning;
"""
STATE = {
    "theta": "P", "psi": "P", "P": "P][P", "claim": "P][P", "granted": "P", "M": "E][L",
    "X": "N+1][L", "noise": "", "samples": "", "signal": "",
}  # fmt: skip
MEASURE = """
static inline void measure(const Tuning *t, State *s, const double *y, double *out) {
#pragma omp simd
  for (int r = 0; r < R; r++) {
    double psi[P], K[P], S[P], form = 1.0, spread = 1.0, excitation = 0.0;
    for (int i = 0; i < P; i++) psi[i] = s->X[N][1 + i]AT;
    for (int i = 0; i < P; i++) {
      K[i] = S[i] = 0.0;
      for (int j = 0; j < P; j++) {
        K[i] += s->P[i][j]AT * psi[j];
        S[i] += s->claim[i][j]AT * psi[j];
      }
      form += psi[i] * K[i];
      spread += psi[i] * S[i];
      excitation += psi[i] * psi[i];
    }
    double noise = s->noiseAT, quiet = noise, samples = s->samplesAT;
    double signal = s->signalAT, yhat = s->X[N][0]AT;
    double e = y[r] - yhat, weight = 1.0 / form;
    double limit = t->clip * sqrt(fmax(noise, 1e-6 * signal) * form);
    double early = 50.0 / samples;
    limit = samples >= 50.0 ? limit : limit * early * early;
    limit = samples > 0.0 ? limit : INFINITY;
    double surprise = e > limit ? limit : e < -limit ? -limit : e;
    double seen = samples > 0.0 ? 0.01 * noise : 0.0;
    double more = fmin(samples + 1.0, t->memory);
    double power = signal + (yhat * yhat - signal) / more;
    double found = noise + (surprise * surprise / spread / t->consistency - noise) / more;
    int excited = excitation > seen;
    s->samplesAT = samples = excited ? more : samples;
    s->signalAT = excited ? power : signal;
    s->noiseAT = noise = excited ? fmax(found, 1e-12 * power) : noise;
    for (int i = 0; i < P; i++) {
      for (int j = 0; j <= i; j++) {
        double a = K[i] * weight, b = K[j] * weight;
        double c = s->claim[i][j]AT + spread * a * b - a * S[j] - S[i] * b;
        s->claim[i][j]AT = s->claim[j][i]AT = c;
        double p = (s->P[i][j]AT - weight * K[i] * K[j]) * t->forgetting;
        s->P[i][j]AT = s->P[j][i]AT = p;
      }
      double theta = s->theta[i]AT + K[i] * (surprise * weight);
      s->theta[i]AT = out[i * R + r] = fmin(fmax(theta, t->lower[i]), t->upper[i]);
      s->psi[i]AT = psi[i];
    }
    for (int i = 0; i < P; i++) {
      double most = fmax(samples < 50.0 ? t->early[i] : t->ceiling / noise, s->granted[i]AT);
      double own = s->P[i][i]AT, factor = own > most ? sqrt(most / own) : 1.0;
      for (int j = 0; j < P; j++) {
        double p = s->P[i][j]AT * factor * (i == j ? factor : 1.0);
        s->P[i][j]AT = s->P[j][i]AT = p;
      }
      s->granted[i]AT = own < s->granted[i]AT ? fmax(own, t->floor[i]) : s->granted[i]AT;
    }
    out[P * R + r] = yhat;
    out[(P + 1) * R + r] = e;
    out[(P + 2) * R + r] = quiet * spread;
  }
}
"""
RUN = """
void run(const Tuning *t, State *s, long samples, const double *u, const double *y, double *out) {
  for (long k = 0; k < samples; k++) {
    measure(t, s, y + k * R, out + k * R * (P + 3));
    over(t, s, u + k * R);
  }
}
"""


def source(pattern: Pattern, runs: int) -> str:
    """Return the whole program for one pattern and so many runs side by side."""
    L = 1 + pattern.p if runs > 1 else pattern.lanes
    sizes = dict(R=runs, p=pattern.p, n=pattern.n, L=L, E=len(pattern.entries))
    fields = ", ".join(f"{name}{f'[{dims}]' if dims else ''}[R]" for name, dims in STATE.items())
    head = HEAD.format(
        **sizes, T=len(pattern.terms), bytes=8 * max(runs, L * (runs == 1)), both=fields
    )
    over = _over_many(pattern) if runs > 1 else _over_one(pattern)
    return head + MEASURE.replace("AT", "[r]") + over + RUN


def _monomial(c: str, exponents) -> str:
    return " * ".join([c] + [f"q{i}" if e > 0 else f"w{i}" for i, e in enumerate(exponents)
                             for _ in range(abs(e))])  # fmt: skip


def _slopes(pattern: Pattern) -> dict[int, dict[int, list[str]]]:
    """Return the summands of every entry that depends on θ, by lane."""
    found = defaultdict(lambda: defaultdict(list))
    for k, (entry, *exponents) in enumerate(pattern.terms):
        c = f"t->coefficient[{k}]"
        found[entry][0].append(_monomial(c, exponents))
        for i, e in enumerate(exponents):
            if e:
                lowered = [f - (i == j) for j, f in enumerate(exponents)]
                found[entry][1 + i].append(_monomial(f"{e}.0 * {c}", lowered))
    return found


def _over_many(pattern: Pattern) -> str:
    n, lanes, slopes = pattern.n, range(1 + pattern.p), _slopes(pattern)
    has = {(k, a) for k in range(len(pattern.entries)) for a in [0, *slopes.get(k, {})]}
    lines = [f"V q{i} = *(V *)s->theta[{i}], w{i} = 1.0 / q{i};" for i in range(pattern.p)]
    for k in range(len(pattern.entries)):
        for a in lanes:
            if (k, a) in has:
                given = slopes[k][a] if k in slopes else None
                value = " + ".join(["(V){0}", *given]) if given else f"*(V *)s->M[{k}][0]"
                lines.append(f"V m{k}_{a} = {value};")

    def row(i, v, held, a):
        terms = []
        for k, (own, j, _) in enumerate(pattern.entries):
            if own == i and j < n:
                terms.append(f"m{k}_0 * {v}{j}_{a}")
                value = f"values[k][{j}]" if v == "v" and a >= TOGETHER else f"{v}{j}_0"
                terms += [f"m{k}_{a} * {value}"] * (a > 0 and (k, a) in has)
            elif own == i and held and (k, a) in has:
                terms.append(f"m{k}_{a} * torque")
        return " + ".join(terms) or "(V){0}"

    lines += [
        f"V x{i}_{a} = *(V *)s->X[{i}][{a}], v{i}_{a} = x{i}_{a};" for i in range(n) for a in lanes
    ]
    lines.append(f"V torque = *(V *)u, values[40][{n}];")
    for group in (lanes[a : a + TOGETHER] for a in lanes[::TOGETHER]):
        kept = "".join(f"values[k][{i}] = v{i}_0;" for i in range(n) if 0 in group)
        for loop, held in (("0; k < 1", True), ("1; k < t->order", False)):
            lines.append(f"for (int k = {loop}; k++) {{{kept}" + _term(n, group, row, held) + "}")
    lines += [f"*(V *)s->X[{i}][{a}] = x{i}_{a};" for i in range(n) for a in lanes]
    lines += [f"*(V *)s->X[{n}][{a}] = {row(n, 'x', False, a)};" for a in lanes]
    return _function(lines)


def _term(n, lanes, row, held) -> str:
    places = [(i, a) for i in range(n) for a in lanes]
    lines = [f"V z{i}_{a} = {row(i, 'v', held, a)};" for i, a in places]
    lines += [f"x{i}_{a} += t->weight[k] * z{i}_{a}; v{i}_{a} = z{i}_{a};" for i, a in places]
    return "\n".join(lines)


def _over_one(pattern: Pattern) -> str:
    n, slopes = pattern.n, _slopes(pattern)
    lines = [f"double q{i} = s->theta[{i}][0], w{i} = 1.0 / q{i};" for i in range(pattern.p)]
    for k in range(len(pattern.entries)):
        if k not in slopes:
            lines.append(f"double m{k} = s->M[{k}][0][0];")
            continue
        given = [" + ".join(slopes[k].get(a, ["0.0"])) for a in range(1 + pattern.p)]
        given += ["0.0"] * (pattern.lanes - len(given))
        lines.append(f"double m{k} = {given[0]};\nV d{k} = {{0.0, {', '.join(given[1:])}}};")

    def row(i, v, held, _):
        terms = []
        for k, (own, j, _) in enumerate(pattern.entries):
            name = f"{v}{j}_0" if j < n else "torque"
            if own == i and (j < n or held):
                terms.append(f"m{k} * {name}")
                terms += [f"d{k} * {name}[0]"] * (k in slopes)
        return " + ".join(terms) or "(V){0}"

    lines += [f"V x{i}_0 = *(V *)s->X[{i}], v{i}_0 = x{i}_0;" for i in range(n)]
    lines.append("V torque = {u[0]};")
    lines.append("for (int k = 0; k < 1; k++) {" + _term(n, [0], row, True) + "}")
    lines.append("for (int k = 1; k < t->order; k++) {" + _term(n, [0], row, False) + "}")
    lines += [f"*(V *)s->X[{i}] = x{i}_0;" for i in range(n)]
    lines.append(f"*(V *)s->X[{n}] = {row(n, 'x', False, 0)};")
    return _function(lines)


def _function(lines) -> str:
    head = "static inline void over(const Tuning *t, State *s, const double *u) {"
    return "\n  ".join([head, *lines]) + "\n}\n"


class Floor:
    """The compiled program for some runs of a filter, with its records."""

    def __init__(self, estimator: Rpem, runs: int, folder: Path, flags: str = FLAGS) -> None:
        pattern, _ = split(estimator._design.model)
        text, library = folder / f"floor{runs}.c", folder / f"floor{runs}.so"
        text.write_text(source(pattern, runs), encoding="utf-8")
        command = [CC, *flags.split(), "-shared", "-fPIC", str(text), "-o", str(library), "-lm"]
        subprocess.run(command, check=True)
        self.run_c = ctypes.CDLL(str(library)).run
        self.runs, self.p, self.lanes = (
            runs,
            pattern.p,
            1 + pattern.p if runs > 1 else pattern.lanes,
        )
        tuning, state = estimator._tuning[0], estimator._begin[0]
        names = ["forgetting", "lower", "upper", "coefficients", "weights", "clip", "memory",
                 "consistency", "ceiling", "floor", "early"]  # fmt: skip
        numbers = np.concatenate([np.ravel(tuning[name]) for name in names])
        order = np.array([int(tuning["order"])]).view(float)
        inflation = np.array([1 / tuning["forgetting"]])
        self.tuning = np.concatenate([inflation, numbers[1:], order])
        self.begin = [np.ravel(state[name][:, : self.lanes] if name in "MX" else state[name])
                      for name in STATE]  # fmt: skip

    def run(self, u, y):
        """Return θ/θ(0), ŷ, ε and its variance (N, p+3, R) of signals (N, R)."""
        state = np.repeat(np.concatenate(self.begin)[:, None], self.runs, axis=1).copy()
        out = np.empty((len(u), self.p + 3, self.runs))
        at = [ctypes.c_void_p(a.ctypes.data) for a in (self.tuning, state, u, y, out)]
        self.run_c(at[0], at[1], ctypes.c_long(len(u)), *at[2:])
        return out


def filter_() -> Rpem:
    """Return the paper's method on the nominal axis, with what is clipped."""
    P0 = [2.97e-4, 5.19e-5, 4.69e-6]
    return Rpem(three_mass(preset("n1").as_dict()), P0=P0, period=0.005, robust=4.0)


def signals(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return u and y of a record of the nominal axis with a fault."""
    record = fx.simulate("fm_step-v1", seed=seed)
    return record.torque, record.speed


def contenders(folder: Path, flags: str = FLAGS) -> dict:
    """Return, by (who, runs), what runs the record in so many runs, once; and how long it is."""
    u, y = signals()
    found = {}
    for runs in (1, 2, 4, 8, 16):
        several = [filter_() for _ in range(runs)]

        def ours(several=several):
            for each in several:
                each.reset()
            start = time.perf_counter()
            run_together(several, [u] * len(several), [y] * len(several))
            return time.perf_counter() - start

        found["ours", runs] = ours
    for runs in (1, registers() or 1):
        program = Floor(filter_(), runs, folder, flags)
        given = [np.repeat(each[:, None], runs, axis=1) for each in (u, y)]

        def theirs(program=program, given=given):
            start = time.perf_counter()
            program.run(*given)
            return time.perf_counter() - start

        found["C", runs] = theirs
    return found


def best(folder: Path, flags: str = FLAGS, rounds: int = 40) -> dict:
    """Return the least time of each for a run-sample [s], all in turn in every round."""
    several, N = contenders(folder, flags), len(signals()[0])
    for run in several.values():
        run()
    rounds_ = [{key: run() for key, run in several.items()} for _ in range(rounds)]
    return {key: min(each[key] for each in rounds_) / N / key[1] for key in several}


def main() -> None:
    """Print the table; where only AVX2 is asked for, in a process that knows of nothing else."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--avx2", action="store_true", help="no AVX-512, for either")
    flags = FLAGS
    if parser.parse_args().avx2:
        flags += " -mno-avx512f"
        if "NUMBA_CPU_NAME" not in os.environ:
            os.environ |= {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": without_avx512()}
            os.execv(sys.executable, [sys.executable, *sys.argv])
    with tempfile.TemporaryDirectory() as folder:
        for (who, runs), seconds in best(Path(folder), flags).items():
            print(f"{who:5} {runs:3} runs  {1e6 * seconds:.4f} µs  {1e-6 / seconds:6.2f} M/s")


def without_avx512() -> str:
    """Return what this machine has besides, as numba wants it."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features().items()
    return ",".join(f"{'+' if on and 'avx512' not in name else '-'}{name}" for name, on in features)


if __name__ == "__main__":
    main()
