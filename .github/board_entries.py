"""Read the names of changed files (NUL-separated), and print the folders of entries to verify.

The names are all that a request changes below entries/, whatever it does to them, renames taken
apart. A name that is none of a file in an entry ends it: what is not looked at is not accepted. A
folder that the request has removed is told and not printed.
"""

import re
import sys
from pathlib import Path

ENTRY = re.compile(r"(entries/[A-Za-z0-9_+-][A-Za-z0-9_.+-]{0,79})/.+", re.DOTALL)
MOST = 5  # entries of one pull request

home = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
names = [n for n in sys.stdin.buffer.read().decode(errors="replace").split("\0") if n]
strange = [name for name in names if not ENTRY.fullmatch(name)]
if strange:
    sys.exit(f"{strange[0]!r} is no file of an entry: entries/NAME/… is")
folders = list(dict.fromkeys(ENTRY.fullmatch(name)[1] for name in names))
if len(folders) > MOST:
    sys.exit(f"{len(folders)} entries in one request; {MOST} are allowed")
there = [folder for folder in folders if (home / folder).exists()]
for folder in folders:
    if folder not in there:
        print(f"{folder}: removed", file=sys.stderr)
if not there:
    sys.exit("there is no entry to verify")
print("\n".join(there))
