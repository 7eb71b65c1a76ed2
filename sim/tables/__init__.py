"""What a scenario is made of: a table of its TOML each, and what may be wrong with them.

In come keys and values, out go frozen tables that know what they do to a run: faults and their
events, references, the loop's gains, sensors, laws of friction. Nothing here runs the engine.
"""
