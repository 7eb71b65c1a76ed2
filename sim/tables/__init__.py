"""Define the tables of a scenario file and their checks.

Each class contains the keys of one table and implements their effect on a run. There are tables for
faults, references, the controller, sensors and friction laws. No module of this package runs the
physics engine.
"""
