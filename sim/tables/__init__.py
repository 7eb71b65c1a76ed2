"""The tables of a scenario file, with their checks.

Each class reads keys and values and knows their effect on a run: faults and their events,
references, controller gains, sensors, friction laws. Nothing here runs the engine.
"""
