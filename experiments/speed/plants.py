"""The plant against its engine: what the closed loop adds to a physics step."""

from __future__ import annotations

import numpy as np

from flexaxis.experiments.speed.problem import Problem
from flexaxis.experiments.speed.rounds import Contender, timed
from flexaxis.sim.controller import Controller
from flexaxis.sim.plant import Plant

RUNS = 64  # of the plant
STEPS, SUBSTEPS = 200, 5  # samples, and physics steps of 1 ms in each


def plants(given: Problem) -> list[Contender]:
    """Return the engine alone, and the closed loop of many runs."""
    from flexaxis.sim.engine import mujoco

    scenario = given.scenario

    def loop() -> None:
        plant = Plant([scenario.nominal] * RUNS, period=scenario.period, substeps=SUBSTEPS)
        controller = Controller(scenario.controller, RUNS, period=scenario.period)
        for _ in range(STEPS):
            plant.step(controller.torque(np.zeros(RUNS), plant.angle_m))

    model = Plant([scenario.nominal], period=scenario.period, substeps=SUBSTEPS).model(0)
    data = mujoco.MjData(model)
    engine = timed(lambda: mujoco.mj_step(model, data, nstep=1000), 1000)
    return [
        Contender("engine", "mj_step(nstep=1000), a physics step of 1 ms", "engine", engine),
        Contender("plant", f"closed loop of {RUNS} runs on one thread, a physics step", "engine",
                  timed(loop, STEPS * SUBSTEPS * RUNS), faster=False),
    ]  # fmt: skip
