"""Exit unless code of an entry would be shut in completely on this computer."""

import sys
import tempfile
from pathlib import Path

from flexaxis.experiments.board.cage import Cage

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder, Cage(Path(folder)) as cage:
        lacks = [what for what, held in cage.reached.items() if not held]
        if lacks or not cage.reached:
            sys.exit(f"not reached here: {', '.join(lacks) or 'anything'}; nothing is run")
        print("an entry would run with", ", ".join(cage.reached))
