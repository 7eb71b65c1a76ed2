"""The tables of a scenario file, with their checks.

Each class holds the keys of one table and implements their effect on a run: faults and events,
references, controller gains, sensors and friction laws. Nothing here runs the physics engine.
"""
