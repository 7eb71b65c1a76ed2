"""`python -m flexaxis` is the same as `flexaxis`."""

import sys

from flexaxis.experiments.cli import main

sys.exit(main())
