"""Compare estimators at equal noise, and for a range of settings of their tuning parameters.

`sweep` runs estimators at several settings of their tuning parameters and uses `matching` to
interpolate the lags to equal noise. `tune` finds the setting at which an estimator is as noisy as
the reference, and `ranking` finds the best estimator and those that are not significantly worse.
"""
