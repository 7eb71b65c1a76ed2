"""Programs that speak binary blocks: the templates in C and Octave, and what misbehaves."""

import json
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.running.user_code import PipeEstimator
from flexaxis.sim.simulate import simulate

CC = shutil.which("cc") or shutil.which("gcc")
OCTAVE = shutil.which("octave-cli")
PYTHON = shlex.quote(Path(sys.executable).as_posix())

# Answers half of what u was, and y where there is one; all that a program may need of the protocol.
HALF = """
import struct, sys
take, give = sys.stdin.buffer.read, sys.stdout.buffer.write
assert take(8) == b"FLEXAXIS"
version, mark = struct.unpack("<II", take(8))
period, output, values, names = struct.unpack("<dIII", take(20))
nominal = {}
for _ in range(values):
    name = take(32).rstrip(b"\\0").decode()
    nominal[name], = struct.unpack("<d", take(8))
asked = [take(32).rstrip(b"\\0").decode() for _ in range(names)]
give(b"FLEXAXIS" + struct.pack("<IIII", version, mark, 2, output))
give(b"k_T".ljust(32, b"\\0") + b"f_m".ljust(32, b"\\0"))
sys.stdout.flush()
while len(count := take(8)) == 8:
    n, = struct.unpack("<Q", count)
    samples = struct.unpack(f"<{2 * n}d", take(16 * n))
    for u, y in zip(samples[::2], samples[1::2]):
        give(struct.pack("<dd", u / 2, y if y == y else -1.0))
    sys.stdout.flush()
"""


@pytest.fixture
def program(tmp_path):
    """A function that writes a program, by replacing something in the one above."""

    def write(*pairs):
        text = HALF
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "program.py"
        path.write_text(text)
        return f"{PYTHON} {shlex.quote(path.as_posix())}"

    return write


def started(command, **more):
    known = {"identify": ["f_m"], "output": "speed"} | more
    return PipeEstimator(command, {"k_T": 1.0, "f_m": 0.05}, 0.005, **known)


@pytest.fixture(scope="module")
def record(short):
    return simulate(short, [0])[0]


@pytest.fixture(scope="module")
def shipped(short, record):
    """The shipped method for f_m alone, from the templates' P(0)."""
    from flexaxis.estimators import Rpem, three_mass

    rpem = Rpem(three_mass(short.nominal.as_dict()), identify=("f_m",), P0=[[5e-6]],
                forgetting=0.995, period=0.005)  # fmt: skip
    return rpem.run(record.torque, record.speed)


def alike(short, record, command, shipped):
    estimator = build(parse(f"pipe:{command}"), short)
    assert tuple(estimator.names) == ("f_m",) and estimator.output == "speed"
    found = run_estimator(estimator, record.torque, record.speed)
    np.testing.assert_allclose(found, shipped, rtol=1e-8)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The template in C as somebody gets it, compiled with every warning as an error."""
    if CC is None:
        pytest.skip("there is no C compiler")
    place = tmp_path_factory.mktemp("c")
    assert main(["new", str(place / "mine.c")]) == 0
    words = [CC, "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]
    where = [str(place / "mine"), str(place / "mine.c")]
    subprocess.run([*words, "-o", *where, "-lm"], check=True)
    return shlex.quote(where[0])


@pytest.mark.slow
def test_the_template_in_c_is_the_shipped_method(short, record, shipped, compiled):
    """Two implementations that share no line; the kernel's Taylor series is good to 1e-13."""
    alike(short, record, compiled, shipped)


@pytest.mark.skipif(OCTAVE is None, reason="GNU Octave is not installed")
def test_the_template_in_octave_is_the_shipped_method(short, record, shipped, tmp_path):
    assert main(["new", str(tmp_path / "mine.m")]) == 0
    alike(short, record, f"octave-cli -q {tmp_path}/mine.m", shipped)


def test_the_template_in_c_keeps_the_rules(compiled, capsys):
    """No look-ahead, step equals run, gaps, and so on, also where samples come in blocks."""
    assert main(["check", f"pipe:{compiled}", "--json"]) == 0
    rules = {r["rule"]: r["holds"] for r in json.loads(capsys.readouterr().out)["rules"]}
    assert rules["no look ahead"] and rules["step equals run"] and rules["survives a gap"]


def test_what_goes_there_and_back(program):
    """More samples than a block has, and gaps; the same step by step."""
    u, y = np.arange(5000.0), -np.arange(5000.0)
    valid = np.arange(5000) % 7 > 0
    estimator = started(program(), output="increment")
    assert estimator.names == ("k_T", "f_m") and estimator.output == "increment"
    theta = estimator.run(u, y, valid)
    np.testing.assert_array_equal(theta, np.stack([u / 2, np.where(valid, y, -1.0)], axis=1))
    assert estimator.step(3.0, None).tolist() == [1.5, -1.0]
    assert estimator.step(3.0, 4.0).tolist() == [1.5, 4.0]


def test_the_header_has_what_there_is_to_know(program, tmp_path):
    heard = tmp_path / "heard"
    saves = f"open({str(heard)!r}, 'w').write(repr([version, period, output, nominal, asked]))\n"
    started(program(('give(b"FLEXAXIS"', f'{saves}give(b"FLEXAXIS"')), identify=["1/J_a", "f_m"])
    assert eval(heard.read_text()) == [1, 0.005, 0, {"k_T": 1.0, "f_m": 0.05}, ["1/J_a", "f_m"]]


FIRST = [
    ("assert take(8)", "sys.exit('no licence')\nassert take(8)", "0 of 24 bytes"),
    ("period, output, v", "print('{}' * 20, flush=True)\nperiod, output, v", r"answered b'\{\}"),
    ('"<IIII", version, mark', '">IIII", version, mark', "header that docs"),
    ('"<IIII", version, mark', '"<IIII", 2, mark', "header that docs"),
    ('.ljust(32, b"\\0"))', ")\nsys.exit()", "ended after sending 35 of 64 bytes"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), FIRST, ids=range(len(FIRST)))
def test_programs_that_fail_at_once(program, old, new, message):
    with pytest.raises(EstimatorError, match=message):
        started(program((old, new)))


def test_a_program_that_fails_later(program):
    ends = program(("for u, y", "sys.exit('no luck')\n    for u, y"))
    with pytest.raises(EstimatorError, match="ended after sending 0 of 80 bytes"):
        estimator = started(ends)
        for _ in range(2):
            time.sleep(0.2)
            estimator.run(np.ones(5), np.ones(5))


def test_its_files_decide_about_its_cases(program):
    before = parse(f"pipe:{program()}").digest
    after = parse(f"pipe:{program(('u / 2', 'u / 3'))}").digest
    assert before != after
    spec = parse("pipe:my program [with, brackets]")  # which belong to the command
    assert spec.name == "pipe:my program [with, brackets]"
    assert not spec.options


EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "pipe_friction.py"


def test_the_example_in_python_is_the_shipped_method(short, record, shipped):
    alike(short, record, f"{PYTHON} {shlex.quote(EXAMPLE.as_posix())}", shipped)
