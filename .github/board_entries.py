"""Read the names of changed files (NUL-separated) and print the folders of entries they lie in."""

import re
import sys

ENTRY = re.compile(r"(entries/[\w.+-]{1,80})/.+", re.DOTALL)
MOST = 5  # entries of one pull request

names = sys.stdin.buffer.read().decode(errors="replace").split("\0")
found = dict.fromkeys(m[1] for name in names if (m := ENTRY.fullmatch(name)))
folders = [f for f in found if not f.endswith(("/.", "/.."))]
if len(folders) > MOST:
    sys.exit(f"{len(folders)} entries in one request; {MOST} are allowed")
print("\n".join(folders))
