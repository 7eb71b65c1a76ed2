"""Compare estimators: at equal noise, over their tuning parameter, with uncertainty.

`sweep` runs estimators over settings of their tuning parameter and interpolates lags at equal
noise, `tune` finds the setting that is as noisy as the reference, and `ranking` tells which
estimator leads and which are tied.
"""
