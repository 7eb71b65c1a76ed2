"""The wheel works outside the tree: all data files are in it, and it needs no checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy
import pytest

ROOT = Path(__file__).parents[1]
# -S keeps the editable installation out, so that only the wheel and its dependencies are seen.
RUN = """
import sys
sys.path[:0] = {paths!r}
from flexaxis.experiments.cli import main
status = main({words!r})
import flexaxis.sim
assert {wheel!r} in flexaxis.sim.__file__, flexaxis.sim.__file__
sys.exit(status)
"""


FRONT = """
import sys
sys.path[:0] = {paths!r}
import flexaxis as fx
assert fx.__file__.startswith({paths!r}[0]), fx.__file__
record = fx.simulate("fm_step-v1", seed=0, duration=12.0)
print(fx.score(fx.estimate(record, "rpem-forgetting")))
print(*fx.estimators())
"""


WORDS = ["--estimator", "frozen", "--seeds", "1", "--jobs", "1", "-o", "out"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    out = tmp_path_factory.mktemp("wheel")
    source = out / "source"
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("no git checkout to build the wheel from")
    for name in listed.stdout.splitlines():  # a copy, so that no build folder lands in the tree
        if (ROOT / name).is_file() and not name.startswith(".typing"):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--wheel-dir", str(out), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    site = out / "site"
    zipfile.ZipFile(next(out.glob("*.whl"))).extractall(site)
    return site


def python(code, folder, path, **given):
    """Run code that sees a wheel, or what it was unpacked to, and what that depends on."""
    paths = [str(path), str(Path(numpy.__file__).parents[1])]
    return subprocess.run(
        [sys.executable, "-S", "-c", code.format(paths=paths, **given)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": ""},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def flexaxis(wheel, folder, *words):
    return python(RUN, folder, wheel, words=list(words), wheel=str(wheel))


def test_nothing_but_flexaxis_lands_in_site_packages(wheel):
    top = {p.name for p in wheel.iterdir() if not p.name.endswith(".dist-info")}
    assert top == {"flexaxis"}


def test_catalogue_is_in_the_wheel(wheel, tmp_path):
    shown = flexaxis(wheel, tmp_path, "list", "--json")
    assert shown.returncode == 0, shown.stderr
    assert "fm_step-v1" in shown.stdout and "smoke" in shown.stdout


@pytest.mark.slow
def test_the_front_door_is_in_the_wheel(wheel, tmp_path):
    assert (wheel / "flexaxis/py.typed").is_file()
    ran = python(FRONT, tmp_path, wheel)
    assert ran.returncode == 0, ran.stderr
    assert "rpem-forgetting" in ran.stdout and "f_m" in ran.stdout


@pytest.mark.slow
def test_runs_beside_a_users_own_experiments_folder(wheel, tmp_path):
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / "__init__.py").write_text("raise RuntimeError('the wrong one')\n")
    ran = flexaxis(wheel, tmp_path, "run", "fm_step", *WORDS)
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
