"""What is proved stands in docs/proof.md, and is proved again where what it depends on changed."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.append(str(Path(__file__).parents[1] / "docs"))
import digests
import making
import proof

pytestmark = pytest.mark.skipif(os.name == "nt", reason="stages are lines of a shell")


def git(folder, *words):
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", *who, *words], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A project of one module, with two stages that leave a mark when they are run."""
    for folder in ("sim", "docs"):
        (tmp_path / folder).mkdir()
    (tmp_path / "sim" / "a.py").write_text('"""Words."""\nx = 1  # more\n')
    page = tmp_path / "docs" / "proof.md"
    page.write_text("# Proof\n\n<!-- table: proof -->\n<!-- end -->\n")
    (tmp_path / "README.md").write_text("Lags, commit 1234567.\n")
    (tmp_path / "pyproject.toml").write_text('[project]\ndependencies = ["numpy>=2"]\n')
    (tmp_path / ".gitignore").write_text("ran*\n")
    git(tmp_path, "init", "-q")
    for module in (digests, making, proof):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(proof, "PAGE", page)
    stages = {
        "code": proof.Stage("echo ran >> ran_code; echo 3 passed", "it runs", ("sim",)),
        "all": proof.Stage(f"echo ran >> ran_all; echo '| in {tmp_path}/b |'", "all"),
    }
    monkeypatch.setattr(proof, "STAGES", stages)
    commit(tmp_path)
    return tmp_path


def commit(place):
    git(place, "add", "-A")
    git(place, "commit", "-q", "-m", "x", "--allow-empty")


def ran(place):
    return [(place / f"ran_{name}").read_text().count("ran") for name in ("code", "all")]


PROVED = proof.STAGES
SLOW = PROVED["slow"].runs


def written(path, text="Other.\n"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


@pytest.mark.parametrize("file", ["glr.md", "data/glr.csv", "images/friction.png", "proof.md"])
def test_a_new_table_or_figure_makes_no_long_test_stale(place, file):
    first, whole = digests.digest(SLOW), digests.digest(())
    written(place / "docs" / file)
    assert digests.digest(SLOW) == first
    assert (digests.digest(()) == whole) == (file == "proof.md")


@pytest.mark.parametrize("file", ["docs/python.md", "docs/labs/lab1.md", "sim/a.py"])
def test_words_that_a_long_test_reads_make_it_stale(place, file):
    first = digests.digest(SLOW)
    written(place / file, '"""Other words."""\nx = 1  # more\n')
    assert digests.digest(SLOW) != first


@pytest.mark.parametrize(("file", "counts"), [
    ("experiments/reporting/run/first.py", False), ("experiments/reporting/run/more.py", True),
    ("experiments/building/worker.py", False), ("experiments/building/processes.py", False),
    ("experiments/building/spread.py", True),
    ("experiments/demo/cli.py", True), ("experiments/logs/track.py", False), ("sim/b.py", True),
])  # fmt: skip
def test_no_number_comes_from_what_writes_a_page(place, file, counts):
    now = digests.stamp()
    written(place / file, "x = 1\n")
    assert (digests.stamp() != now) == counts
    commit(place)
    assert digests.digest(digests.NUMBERS, "HEAD") == digests.stamp().partition("-")[0]


@pytest.mark.parametrize(("file", "stages"), [
    ("sim/b.py", {"mutants", "fuzz", "kills", "standard"}), ("tests/sim/test_a.py", {"mutants"}),
    ("tests/fuzz/run.py", {"mutants", "fuzz"}), ("docs/examples/a.toml", {"fuzz"}),
    ("tests/experiments/kept_rows.py", {"mutants", "kills"}), ("tests/browser/a.py", set()),
])  # fmt: skip
def test_what_runs_no_other_test_depends_on_none(place, file, stages):
    before = {name: proof.key(PROVED[name]) for name in ("mutants", "fuzz", "kills", "standard")}
    written(place / file, "x = 1\n")
    assert {name for name, key in before.items() if proof.key(PROVED[name]) != key} == stages


def test_who_kills_is_known_with_all_that_it_imports():
    root = Path(digests.__file__).parents[1]
    text = (root / "tests" / "experiments" / "kills.py").read_text(encoding="utf-8")
    imported = re.findall(r"^from (tests\.[\w.]+) import", text, re.MULTILINE)
    assert {f"{name.replace('.', '/')}.py" for name in imported} == {
        name for name in PROVED["kills"].runs if name.startswith("tests")
    } - {"tests/experiments/kills.py"}


def test_a_stage_is_run_again_where_what_it_depends_on_has_changed(place, monkeypatch):
    assert proof.main([]) == 0 and ran(place) == [1, 1]
    assert proof.rows()["code"][-1] == "3 passed" and proof.rows()["all"][-1] == "| in b |"
    commit(place)  # the page itself, and nothing else
    assert proof.main([]) == 0 and ran(place) == [1, 1]
    (place / "sim" / "a.py").write_text("x = 1  # other words\n")
    commit(place)
    assert [line.split(":")[0] for line in proof.stale()] == ["README.md", "all"]
    assert proof.main([]) == 0 and ran(place) == [1, 2]
    (place / "sim" / "a.py").write_text("x = 2\n")
    commit(place)
    assert [line.split(":")[0] for line in proof.stale()] == ["README.md", "code", "all"]
    assert proof.main(["code"]) == 0 and ran(place) == [2, 2]
    library = SimpleNamespace(metadata={"Name": "numpy"}, version="99")
    monkeypatch.setattr(digests, "distributions", lambda: [library])
    assert proof.main(["code"]) == 0 and ran(place) == [3, 2]


def test_what_fails_is_not_shown_and_what_was_shown_stays(place, monkeypatch):
    monkeypatch.setitem(proof.STAGES, "code", proof.Stage("echo 1 failed; false", "no", ("sim",)))
    assert proof.main([]) == 1
    assert set(proof.rows()) == {"all"}


def test_what_changes_while_it_is_looked_at_shows_nothing(place, monkeypatch):
    edits = proof.Stage("echo 'x = 5' > sim/a.py; echo 3 passed", "it edits", ("sim",))
    monkeypatch.setitem(proof.STAGES, "code", edits)
    assert proof.main(["code"]) == 1 and not proof.rows()


def test_what_writes_pages_leaves_them_to_be_committed(place, monkeypatch):
    makes = proof.Stage("echo More. >> README.md; echo made", "tables", ("sim",), writes=True)
    monkeypatch.setitem(proof.STAGES, "code", makes)
    with pytest.raises(SystemExit, match=r"commit this first\n M README\.md"):
        proof.main([])
    assert proof.rows()["code"][-1] == "made"
    commit(place)
    assert proof.main([]) == 0
    assert (place / "README.md").read_text().count("More.") == 1


@pytest.mark.parametrize("file", ["sim/a.py", "README.md", "Makefile"])
def test_nothing_is_proved_of_what_is_in_no_commit(place, file):
    (place / file).write_text("x = 3\n")
    with pytest.raises(SystemExit, match="commit this first"):
        proof.main(["code", "all"])


def test_a_table_of_older_code_is_told_by_its_commit(place):
    proof.main([])
    now = head(place)
    (place / "docs" / "a.md").write_text(f"Now, commit {now}.\nThen, commit {now}-dirty.\n")
    first, dirty, *stages = proof.stale()
    assert first == "README.md:1: of 1234567, which is not in this history"
    assert dirty == f"docs/a.md:2: of {now}-dirty, code that is in no commit"
    assert stages == [f"all: shown at {now}"]
    (place / "sim" / "a.py").write_text("x = 2\n")
    commit(place)
    assert proof.stale()[1] == f"docs/a.md:1: of {now}, 1 commits ago"


def test_a_table_on_own_logs_alone_is_of_what_reads_logs(place):
    written(place / "docs" / "logs.md", f"Rails, commit {head(place)}.\n")
    written(place / "README.md", f"Lags, commit {head(place)}.\n")
    written(place / "experiments" / "logs" / "track.py", "x = 1\n")
    (told,) = [line for line in proof.stale() if ".md:" in line]
    assert told.startswith("docs/logs.md:1: of ")


def test_no_table_but_that_of_logs_is_made_by_what_reads_them():
    """What may read logs is above all that makes tables: commands, and names for notebooks."""
    root = Path(digests.__file__).parents[1]
    files = [*(root / "docs").glob("*.py"), root / "tests" / "estimators" / "test_laws.py"]
    for folder in ("sim", "estimators", "experiments"):
        files += (root / folder).rglob("*.py")
    assert len(files) > 300
    reading = {path.relative_to(root).as_posix() for path in files
               if re.search(r"experiments\.logs|experiments import .*logs",
                            path.read_text(encoding="utf-8"))}  # fmt: skip
    of_logs = ("experiments/logs/", "experiments/commands/axis/")
    others = {name for name in reading if not name.startswith(of_logs)}
    assert others == {"experiments/front/_logs.py", "experiments/commands/words.py",
                      "experiments/commands/runs/simulate.py"}  # fmt: skip


def head(place):
    words = ["git", "rev-parse", "--short=8", "HEAD"]
    return subprocess.check_output(words, cwd=place, text=True).strip()


def test_a_table_is_of_its_commit_whatever_its_digest_was_made_of(place):
    line = f"Lags, commit {head(place)}, digest {'0' * 10}"
    lines = [line, f"{line}-{'0' * 6}", f"{line}-{digests.libraries()}"]
    (place / "README.md").write_text(".\n".join(lines))
    of_tables = [line for line in proof.stale() if line.startswith("README")]
    assert of_tables == [f"README.md:2: of {head(place)}, with other libraries"]


def test_a_table_is_told_by_the_digest_below_it(place, monkeypatch):
    """Whatever became of its commit: of code and data, without comments, and of the libraries."""
    now = making.commit()
    assert re.fullmatch(rf"{head(place)}, digest [0-9a-f]{{10}}-[0-9a-f]{{6}}", now)
    lost = now.replace(head(place), "7654321")
    (place / "README.md").write_text(f"Lags, commit {lost}.\nOlder, commit {lost[:-7]}, seeds.\n")
    (place / "sim" / "a.py").write_text("x = 1  # other words\n")
    of_tables = [line for line in proof.stale() if line.startswith("README")]
    assert not of_tables
    monkeypatch.setattr(digests, "version", lambda name: "99")
    first, *_ = proof.stale()
    assert first == "README.md:1: of 7654321, with other libraries"
    (place / "sim" / "a.py").write_text("x = 2\n")
    why = "which is not in this history"
    assert proof.stale()[:2] == [f"README.md:{n}: of 7654321, {why}" for n in (1, 2)]


def test_a_table_is_refused_while_its_code_is_in_no_commit(place):
    (place / "README.md").write_text("Words.\n")
    assert making.commit().startswith(f"{head(place)}, digest ")
    (place / "sim" / "a.py").write_text("x = 3\n")
    with pytest.raises(SystemExit, match="commit this first"):
        making.commit()
