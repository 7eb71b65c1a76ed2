"""stdout and stderr may be closed, full, or short of letters: no result is lost, no status lies."""

import io
import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from flexaxis.experiments.cli import _told, main
from flexaxis.experiments.commands.answers import FINDING, FINE, WRONG_USE, say
from flexaxis.experiments.streams import Stream, forgiving

pytestmark = pytest.mark.skipif(os.name == "nt", reason="these are streams of Unix")

FULL = Path("/dev/full")
full = pytest.mark.skipif(not FULL.exists(), reason="there is no full device")
RUN = ["run", "short.toml", "--estimator", "frozen", "--seeds", "1", "--jobs", "1", "-o", "out"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, short_toml):
    monkeypatch.chdir(tmp_path)


def shell(line, **more):
    """Run a line of a shell, where `flexaxis` is this one."""
    python = f"'{sys.executable}' -m flexaxis"
    environment = {**os.environ, **more}
    return subprocess.run(
        ["sh", "-c", line.replace("flexaxis", python, 1)],
        check=False,
        capture_output=True,
        text=True,
        errors="surrogateescape",
        env=environment,
        timeout=120,
    )


@full
def test_a_full_stdout_is_an_error_in_one_line():
    for words in ("show fm_step-v1", "list suites", "show fm_step-v1 --json"):
        found = shell(f"flexaxis {words} >/dev/full")
        assert found.returncode == WRONG_USE
        assert found.stderr.splitlines() == [
            "flexaxis: stdout: cannot be written: No space left on device. What was to be said "
            "there is lost"
        ]


@full
def test_a_full_stdout_keeps_the_status_of_a_finding():
    """A verdict is true whether or not somebody could read it."""
    with FULL.open("w") as file:
        out = Stream(file)
        print("worse", file=out)
        assert (_told(out, FINDING), _told(out, FINE)) == (FINDING, WRONG_USE)


@pytest.mark.slow
@full
def test_a_full_stderr_stops_nothing():
    found = shell(f"flexaxis {' '.join(RUN)} 2>/dev/full")
    assert found.returncode == FINE and Path("out/report.html").exists()
    assert shell("flexaxis show nothing 2>/dev/full").returncode == WRONG_USE


def test_an_error_does_not_go_to_stdout_where_stderr_is_closed():
    found = shell("flexaxis show nothing 2>&-")
    assert (found.returncode, found.stdout, found.stderr) == (WRONG_USE, "", "")


def test_no_file_takes_the_place_of_a_closed_stream():
    """What a library says there would stand in the file."""
    line = (
        "import os; from flexaxis.experiments.streams import Stream, forgiving\n"
        "with forgiving(): file = open('rows', 'w'); os.write(2, b'words'); os.write(1, b'words')\n"
        "print(file.fileno() > 2, file=open('answer', 'w'))"
    )
    subprocess.run(["sh", "-c", f'"{sys.executable}" -c "{line}" <&- >&- 2>&-'], check=True)
    assert Path("rows").read_text() == "" and Path("answer").read_text() == "True\n"


@pytest.mark.slow
def test_letters_that_a_terminal_has_not_are_numbers():
    ascii_only = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    found = shell(f"flexaxis {' '.join(RUN)}", **ascii_only)
    assert found.returncode == FINE and "\\u03b8" in found.stdout
    found = shell(f"flexaxis {' '.join(RUN)} --json", **ascii_only)
    assert json.loads(found.stdout)["status"] == FINE
    for name in ("ö", "θ"):
        found = shell(f"flexaxis show {name} --json", PYTHONIOENCODING="ascii", PYTHONUTF8="1")
        assert f"'{name}'" in json.loads(found.stdout)["error"]


def test_an_unknown_width_is_no_width():
    found = shell("flexaxis list suites", COLUMNS="0")
    assert "standard" in found.stdout


def test_a_word_that_is_no_text_is_refused():
    found = shell("flexaxis show \"$(printf 'a\\377.toml')\" --json")
    assert found.returncode == WRONG_USE and "Traceback" not in found.stderr
    assert "'a\\udcff.toml' is no text" in json.loads(found.stdout)["error"]


def test_an_error_does_not_drive_the_terminal(capsys):
    say("unknown \x1b[31mname\x07\u202e of θ")
    assert capsys.readouterr().err == "flexaxis: unknown \\x1b[31mname\\x07\\u202e of θ\n"


def test_a_card_does_not_drive_the_terminal(capsys, short_toml):
    lines = Path(short_toml).read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if not line.startswith("card"))
    Path("card.toml").write_text('card = "one\\u001b[31m two"\n' + text, encoding="utf-8")
    assert main(["show", "card.toml"]) == FINE
    out = capsys.readouterr().out
    assert out.isascii() and "\x1b" not in out and "# tests: one\\x1b[31m two" in out


def test_the_streams_are_as_they_were():
    usual = sys.stdout, sys.stderr, getattr(sys.stdout, "errors", None)
    with forgiving():
        assert sys.stdout is not usual[0]
    assert usual == (sys.stdout, sys.stderr, getattr(sys.stdout, "errors", None))


def test_a_pipe_is_no_log(capsys):
    """It can be read once only, and one that nobody writes to is waited for for ever."""
    os.mkfifo("log.csv")
    assert main(["import", "log.csv"]) == WRONG_USE
    assert "log.csv is no file but a pipe" in capsys.readouterr().err


def test_what_code_of_a_user_closes_is_said_and_ends_nothing():
    closed = io.StringIO()
    closed.close()
    stream = Stream(closed)
    assert stream.write("x") == 1
    stream.flush()
    assert "closed" in stream.problem


NASTY = "x\x1b]52;c;cm0gLXJm\x07\x1b[2J\x1b[6n\x9b6n\x1bP+q\x1b\\\u202e\u061c\x1b[8my"
SHOWN = r"x\x1b]52;c;cm0gLXJm\x07\x1b[2J\x1b[6n\x9b6n\x1bP+q\x1b\\u202e\u061c\x1b[8my"


def _through_a_terminal(write):
    """Return what a terminal gets of what is written to our stdout."""
    ours, theirs = os.openpty()
    with open(theirs, "w", encoding="utf-8") as file:
        write(Stream(file))
    found = bytearray()
    with suppress(OSError):  # at the end, as nobody writes any more
        while piece := os.read(ours, 1 << 16):
            found += piece
    os.close(ours)
    return found.decode().replace("\r\n", "\n")


def test_a_terminal_obeys_no_name():
    assert _through_a_terminal(lambda out: print(NASTY, file=out)) == SHOWN + "\n"
    assert _through_a_terminal(lambda out: out.writelines([NASTY, "\n"])) == SHOWN + "\n"


def test_tables_and_bars_reach_a_terminal_as_they_are():
    from rich.console import Console
    from rich.progress import Progress

    drawn = []

    def draw(out):
        console = Console(file=out, force_terminal=True, color_system="truecolor", width=60)
        console.print("[bold red]θ̂[/] \u00a0 [on blue]–[/]")
        with Progress(console=console) as progress:
            for _ in progress.track(range(3)):
                progress.refresh()

    def both(out):
        write = out.write
        out.write = lambda text: drawn.append(text) or write(text)
        draw(out)

    shown = _through_a_terminal(both)
    assert shown == "".join(drawn).replace("\r\n", "\n") and "\x1b[" in shown


def test_what_goes_to_a_file_is_what_was_said(tmp_path):
    with (tmp_path / "out").open("w+", encoding="utf-8", newline="") as file:
        assert Stream(file).write(NASTY) == len(NASTY)
        file.seek(0)
        assert file.read() == NASTY
