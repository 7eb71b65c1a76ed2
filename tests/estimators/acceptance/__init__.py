"""What every registered estimator is measured by: exact axes, changes of unit, disturbances."""
