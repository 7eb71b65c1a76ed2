"""What is asked of the engine: studies from files, runs, sweeps over knobs, tuning."""
