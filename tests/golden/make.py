"""Write the goldens anew, and print what moved: `python tests/golden/make.py [scores|records]`.

For a change that is meant. Its list of what moved belongs into the message of the commit.
"""

import json
import sys

import contents


def make_scores() -> list[str]:
    """Write scores.jsonl and return what moved."""
    old = contents.golden_rows() if contents.SCORES.exists() else []
    new = [row for name in contents.SCENARIOS for row in contents.score_rows(name)]
    text = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in new)
    contents.SCORES.write_text(text, encoding="utf-8")
    return contents.moves(old, new)


def make_records() -> list[str]:
    """Write records.json and return what moved."""
    old = contents.golden_digests()["scenarios"] if contents.RECORDS.exists() else {}
    made = contents.digests()
    new = made["scenarios"]
    # a line a scenario, so that a difference in the repository names it
    lines = [f"  {json.dumps(name)}: {json.dumps(new[name])}" for name in sorted(new)]
    head = [f'{{"made_with": {json.dumps(made["made_with"])},', '"scenarios": {']
    text = "\n".join([*head, ",\n".join(lines), "}}"]) + "\n"
    contents.RECORDS.write_text(text, encoding="utf-8")
    return contents.record_moves(old, new)


def main(wanted: list[str]) -> None:
    """Write what is wanted, both if nothing is named."""
    makers = {"scores": make_scores, "records": make_records}
    if wrong := set(wanted) - set(makers):
        sys.exit(f"no golden is called {min(wrong)!r}: scores or records")
    for name in wanted or makers:
        print(f"{name}:", *(makers[name]() or ["nothing moved"]), sep="\n  ")


if __name__ == "__main__":
    main(sys.argv[1:])
