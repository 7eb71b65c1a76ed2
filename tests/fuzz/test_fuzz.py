"""Whatever stands in a file, there is an answer in time, or an error that says what is wrong.

Some seconds of it; `make fuzz` goes on for as long as one likes.
"""

import contextlib
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("hypothesis", reason="needs hypothesis, which pip install .[test] brings")
pytest.importorskip("resource", reason="needs limits of memory, which this system has not")
sys.path.insert(0, str(Path(__file__).parent))

import run
from targets import TARGETS, fault, prepare

FOUND = sorted((Path(__file__).parent / "found").glob("*/*"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What commands want beside the file in question."""
    place = tmp_path_factory.mktemp("fuzz")
    prepare(place)
    return place


EXAMPLES = {  # of those that take a tenth of a second and more each
    **dict.fromkeys(("told", "summary", "axis", "hdf5", "map"), 12),
    **dict.fromkeys(("rows", "pipe", "study"), 6),
    "mat": 4,  # read by a process of its own
}
MANY = 40


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", TARGETS)
def test_bad_files_are_told_so(kind, folder):
    # the same files every time, so that who broke it is known; `make fuzz` draws others
    tried, text, data = run.batch(kind, 20261122, EXAMPLES.get(kind, MANY), folder)
    assert not text, f"{text}\nby {data!r}"
    assert tried >= EXAMPLES.get(kind, MANY) // 2


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", FOUND, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_was_found_once_stays_mended(path, folder):
    assert not run.attempt(path.parent.name, path.read_bytes(), folder)


@pytest.mark.parametrize("kind", TARGETS)
def test_the_good_ones_are_taken(kind, folder):
    path = run.placed(kind, TARGETS[kind].good(folder)[0], folder)
    assert TARGETS[kind].act(path) in {0, 1}


def crash(path):
    raise KeyError(path)


def hang(path):
    while True:
        pass


def wait(path):
    with contextlib.suppress(OSError):  # for which the end of its time is not to be taken
        time.sleep(60)
    return 0


def grow(path):
    bytearray(3 << 30)
    return 0


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (crash, "KeyError"),
        (hang, "no answer"),
        (wait, "no answer"),
        (grow, "MemoryError"),
        (lambda path: 70, "status 70"),
        (lambda path: 2, "without a word"),
        (lambda path: print("flexaxis: " + "x" * 5000, file=sys.stderr) or 1, "5010 characters"),
    ],
)
def test_what_counts_as_a_fault(act, said, tmp_path):
    assert said in fault(act, tmp_path, seconds=0.2)
