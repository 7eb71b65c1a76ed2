"""The engine, MuJoCo, imported so that nothing in the current folder is run.

It imports a library for windows, which starts a Python to ask for the version of another.
"""

from __future__ import annotations

from flexaxis.sim.storage.current_folder import safe_path

with safe_path():
    import mujoco
    from mujoco.batch import Batch

__all__ = ["Batch", "mujoco"]
