"""
Three estimators, a scenario each for friction, load and torque: the plot of a benchmark
========================================================================================
"""

import flexaxis as fx

names = ["rpem-forgetting", "ekf", "glr"]
results = fx.benchmark(names, scenarios=["fm_step-v1", "ja_step-v1", "kt_step-v1"], seeds=2)
results.plot()
