"""verdict.md goes into comments on a change: names in it are text, whatever they hold."""

import json
import re
from html import unescape

import pytest
from markdown_it import MarkdownIt

from flexaxis.experiments.files import SUMMARY
from flexaxis.experiments.gate.report import markdown
from flexaxis.experiments.gate.stored import compare_runs
from flexaxis.experiments.gate.wording import COLUMNS

NAMES = [
    "fm_step-v1",
    "</td><img src=x onerror=alert(1)>",
    "a|b",
    "`tick` <b>bold</b>",
    "```",
    "[click](http://evil.example)",
    "![picture](http://evil.example/p.png)",
    "*much* __more__ ~~less~~",
    "see www.evil.example or https://evil.example",
    "@someone #1",
    "two\n\n# lines",
    "\\|<i>",
    "pipe:sh -c 'a || b'",
    "&lt;b&gt;",
]


@pytest.fixture
def stored_run(tmp_path, stored):
    """Write a run as it is stored, and return its folder."""

    def write(folder, name, estimator):
        one = {"scenario": name, "hash": "h", "estimator": estimator, "parameter": name}
        one |= {"lag": 1.0, "std": 1.0, "diverged": False, "never_settled": False}
        stored(tmp_path / folder, [{"case": str(s), **one, "seed": s} for s in range(8)])
        (tmp_path / folder / SUMMARY).write_text(json.dumps({"versions": {}}))
        return tmp_path / folder

    return write


@pytest.mark.parametrize("name", NAMES)
def test_names_are_text(name, stored_run):
    """Read by a parser of Markdown: every cell has the text of the name, and no tag but code."""
    runs = stored_run("old", name, name), stored_run("new", name, f"my {name}")
    found = compare_runs(*runs, {"lag": 0.02})
    html = MarkdownIt("commonmark").enable("table").render(markdown(found))
    tags = set(re.findall(r"</?([a-zA-Z0-9]+)", html))
    assert tags <= {"p", "strong", "code", "table", "thead", "tbody", "tr", "th", "td"}
    assert html.count("<th>") == len(COLUMNS) and html.count("<table>") == 1
    text = " ".join(name.split())
    first, second, *_ = [_text(cell) for cell in re.findall(r"<td>(.*?)</td>", html)]
    assert first == text and second == f"lag {text}"
    line = next(part for part in html.splitlines() if part.startswith("<p>base"))
    assert _text(line) == f"base {text}, candidate my {text}"
    # GitHub makes links of these outside of code, which this parser does not know.
    outside = re.sub(r"<code>.*?</code>", "", html)
    assert not re.search(r"@\w|#\d|www\.|://", outside)


def _text(html):
    return unescape(re.sub(r"<[^>]*>", "", html))
