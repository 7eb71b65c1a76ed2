"""Compare estimators: at equal noise, over their tuning parameter, with uncertainty.

`sweep` runs estimators over settings of their tuning parameter, and `tune` finds the setting that
is as noisy as the reference. `matching` interpolates lags at equal noise, `ranking` says which
estimator leads and which are tied, and `finds` counts what is detected.
"""
