"""Compare estimators at equal noise and over a range of their tuning parameters.

`sweep` runs estimators at several settings of their tuning parameters and interpolates the lags at
equal noise, `tune` finds the setting that is as noisy as the reference, and `ranking` finds the
best estimator and those tied with it.
"""
