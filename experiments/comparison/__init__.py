"""Compare estimators at equal noise and at several settings of their tuning parameters.

The module `sweep` runs estimators at several settings of their tuning parameters. The module
`noise_interpolation` interpolates the lag of an estimator to the noise level of a reference
estimator. The module `tune` finds the setting at which an estimator is as noisy as the reference
estimator. The module `ranking` finds the best estimator, and all estimators that are not
significantly worse.
"""
