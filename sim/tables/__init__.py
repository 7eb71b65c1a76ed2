"""Define the tables of a scenario file and their checks.

Each class defines the keys of one scenario table and implements their effect on a run. The tables
define faults, references, the controller, sensors and nonlinear effects such as friction. No module
of this package calls the physics engine.
"""
