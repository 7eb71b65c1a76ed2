"""The rows in a folder as anyone reads them: by SQLite and the view `scores`."""

import sqlite3
from contextlib import closing


def lines_of(folder, query="SELECT * FROM scores ORDER BY rowid"):
    """Return the rows of all files of a folder, by column."""
    found = []
    for path in sorted(folder.glob("scores*.sqlite")):
        with closing(sqlite3.connect(path)) as db:
            db.row_factory = sqlite3.Row
            found += [dict(line) for line in db.execute(query.replace("ORDER BY rowid", ""))]
    return found


def scores_of(folder):
    """Return the rows by what they are of, without what they cost; none may be there twice."""
    found = {}
    for line in lines_of(folder):
        key = line["hash"], line["estimator"], line["code"], line["seed"], line["parameter"]
        assert key not in found
        found[key] = {name: v for name, v in line.items() if not name.startswith("cost.")}
    return found


def cases_of(folder):
    """Return the number of cases in a folder."""
    return len({(line["case"], line["code"]) for line in lines_of(folder)})


def change(folder, query, *given):
    """Change what is in the file of a folder."""
    with closing(sqlite3.connect(folder / "scores.sqlite")) as db, db:
        db.execute(query, given)
