"""Programs as estimators: the examples of the documentation, and programs that misbehave."""

import gc
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.building.pipe import PipeEstimator
from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.running.bench import Bench
from flexaxis.sim.simulate import simulate

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
PYTHON = f'"{Path(sys.executable).as_posix()}"'
OCTAVE = shutil.which("octave-cli")
HEADER = 'import json, sys; h = json.loads(input()); print(\'{"names": ["f_m"]}\', flush=True); '


@pytest.fixture(scope="module")
def record(short):
    return simulate(short, [0])[0]


def example(name):
    path = (EXAMPLES / name).as_posix()
    return f'{PYTHON} "{path}"' if name.endswith(".py") else f'octave-cli -q "{path}"'


def estimates(command, short, record):
    estimator = build(parse(f"pipe:{command}"), short)
    assert tuple(estimator.names) == ("f_m",) and estimator.output == "speed"
    return run_estimator(estimator, record.torque, record.speed)


def shipped(short, record):
    """The shipped method for f_m alone, from the example's P(0)."""
    from flexaxis.estimators import Rpem, three_mass

    rpem = Rpem(
        three_mass(short.nominal.as_dict()),
        identify=("f_m",),
        P0=[[5e-6]],
        forgetting=0.995,
        period=0.005,
    )
    return rpem.run(record.torque, record.speed)


def test_the_python_example_is_the_shipped_method(short, record):
    """Two implementations that share no line; the kernel's Taylor series is good to 1e-13."""
    found = estimates(example("pipe_friction.py"), short, record)
    np.testing.assert_allclose(found, shipped(short, record), rtol=1e-8)


@pytest.mark.skipif(OCTAVE is None, reason="GNU Octave is not installed")
def test_the_octave_example_is_the_shipped_method(short, record):
    found = estimates(example("pipe_friction.m"), short, record)
    np.testing.assert_allclose(found, shipped(short, record), rtol=1e-8)


def test_in_the_benchmark(short):
    text = f"pipe:{example('pipe_friction.py')}"
    (((row,),),) = Bench([short]).runs([short], [text], [0]).values()
    assert row["parameter"] == "f_m" and 0 < row["lag"] < 2


def test_what_is_said(tmp_path):
    """The header, samples and a gap, as a program sees them."""
    script = tmp_path / "echo.py"
    script.write_text(
        "import json, sys\n"
        "lines = []\n"
        "for line in sys.stdin:\n"
        "    lines.append(line)\n"
        "    open(sys.argv[1], 'w').writelines(lines)\n"
        "    print(json.dumps({'names': 'f_m', 'theta': len(lines)}), flush=True)\n"
    )
    heard = tmp_path / "heard"
    command = f'{PYTHON} "{script.as_posix()}" "{heard.as_posix()}"'
    estimator = PipeEstimator(command, {"f_m": 0.05}, 0.005, identify=["f_m"], output="increment")
    assert estimator.names == ("f_m",) and estimator.output == "increment"
    assert estimator.step(0.25, 1.5).tolist() == [2.0]  # a number will do for one parameter
    assert estimator.step(0.5, None).tolist() == [3.0]
    assert heard.read_text().splitlines() == [
        '{"flexaxis": 1, "names": ["f_m"], "nominal": {"f_m": 0.05}, "period": 0.005, '
        '"output": "increment"}',
        '{"u": 0.25, "y": 1.5}',
        '{"u": 0.5, "y": null}',
    ]


def test_the_program_ends_with_the_estimator():
    estimator = PipeEstimator(f'{PYTHON} -c "{escaped(HEADER)}sys.stdin.read()"', {}, 0.005)
    process = estimator._lines.program.process
    assert process.poll() is None
    del estimator
    gc.collect()
    assert process.poll() is not None


def escaped(code):
    return code.replace('"', '\\"')


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import sys; sys.exit('no licence')", r"ended with status 1 .*no licence"),
        ("print('hello', flush=True); input()", "answered 'hello'; one JSON object"),
        ("print('{}', flush=True); input()", "has no 'names'"),
    ],
)
def test_programs_that_fail_at_once(code, message):
    with pytest.raises(EstimatorError, match=message):
        PipeEstimator(f'{PYTHON} -c "{escaped(code)}"', {}, 0.005)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("input(); print('[1]', flush=True); input()", r"answered '\[1\]'"),
        ("""input(); print('{"theta": [1, 2]}', flush=True); input()""", r"shape \(2,\)"),
        ("input(); raise ValueError('bad luck')", "status 1 .*bad luck"),
        ("raise SystemExit('this is no flexaxis on stdin')", "blocks of numbers is pipe-binary:"),
        ("sys.stdin.read()", "did not answer within 0.5 s"),
    ],
)
def test_programs_that_fail_later(code, message):
    estimator = PipeEstimator(f'{PYTHON} -c "{escaped(HEADER + code)}"', {}, 0.005, patience=10)
    estimator._lines.program.patience = 0.5  # the start of Python may take longer
    with pytest.raises(EstimatorError, match=message):
        estimator.step(0.0, 0.0)


@pytest.mark.parametrize("command", ["", "no-such-program -x", '"'])
def test_programs_that_are_not_there(short, command):
    with pytest.raises(EstimatorError, match="cannot be started"):
        build(parse(f"pipe:{command}"), short)


def test_brackets_belong_to_the_command():
    assert parse("pipe:prog [x]").make.args == ("prog [x]",)
