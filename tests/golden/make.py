"""Write the goldens again, and print what moved: `python tests/golden/make.py [scores|records]`.

For a change that is meant. Its list of what moved belongs into the message of the commit.
"""

import json
import sys

import contents


def make_scores() -> list[str]:
    """Write scores.jsonl and return what moved."""
    old = contents.golden_rows()
    new = [row for name in contents.SCENARIOS for row in contents.score_rows(name)]
    text = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in new)
    contents.SCORES.write_text(text, encoding="utf-8")
    return contents.score_moves(old, new)


def make_records() -> list[str]:
    """Write records.json, a line a scenario, and return what moved."""
    old, new = contents.golden_records(), {n: contents.projections(n) for n in contents.recorded()}
    lines = [f"{json.dumps(name)}: {json.dumps(new[name])}" for name in new]
    contents.RECORDS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    return [f"{name} {line}" for name in sorted(old.keys() | new.keys())
            for line in contents.record_moves(old.get(name, {}), new.get(name, {}))]  # fmt: skip


if __name__ == "__main__":
    makers = {"scores": make_scores, "records": make_records}
    for choice in sys.argv[1:] or makers:
        print(f"{choice}:", *(makers[choice]() or ["nothing moved"]), sep="\n  ")
