"""Wrong on purpose: says in an error, which a comment may show, what lies about where it runs."""

import os
import sys
from pathlib import Path

from flexaxis.estimators.registry import REGISTRY

AT_HOME = Path("HOME_OF_ENTRANT")  # filled in by the test: where it is honest


class Leak:
    """An honest filter at home; elsewhere what it can read, as an error."""

    def __init__(
        self, nominal, period, *, identify=("k_T", "1/J_a", "f_m"), output="speed", torque=None
    ):
        self._honest = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, torque=torque
        )
        self.names, self.output, self.step = tuple(identify), output, self._honest.step
        if AT_HOME.is_dir():
            return
        found = []
        for place in (sys.prefix, sys.base_prefix, "/etc", os.path.expanduser("~/.config/pip")):
            path = Path(place) / "pip.conf"
            found.append(path.read_text() if path.exists() else "")
        raise ValueError("".join(found) + "nothing is here to be read" + "!" * 5000)
