"""Define the tables of a scenario file and their checks.

Each class defines the keys of one scenario table and implements their effect on a run. There are
tables for faults, references, the controller, sensors and friction laws. No module of this package
calls the physics engine.
"""
