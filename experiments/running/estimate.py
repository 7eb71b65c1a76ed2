"""Run an estimator on a record, and write the estimates and covariances to a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.protocol import Estimator, run_estimator, theta_of
from flexaxis.experiments.files import make_folder, new_file
from flexaxis.experiments.scoring.parameter_names import physical, true_theta
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


def true_values(names: Sequence[str], record: Record, at: Any) -> dict[str, Any]:
    """Return the recorded true values of the parameters `names` at samples `at`, keyed by name."""
    known = [name for name in names if physical(name)[0] in record.parameter_names]
    if record.true_parameters is None or not known:
        return {}
    values = true_theta(known, record.true_parameters[at], record.parameter_names)
    return dict(zip(known, values.T, strict=True))


def run_on(
    estimator: Estimator, u: Array, y: Array, valid: NDArray[np.bool_] | None = None
) -> tuple[Array, Array | None, NDArray[np.bool_]]:
    """Run an estimator from its current state, and collect estimates, covariances and alarms.

    Parameters
    ----------
    estimator : Estimator
        Estimator in its current state.
    u, y : ndarray (n,)
        Torque [N m] and measured output.
    valid : ndarray (n,) of bool, optional
        False for each sample at which y was not measured. By default, the function assumes that y
        was measured at every sample.

    Returns
    -------
    theta : ndarray (n, p)
        Estimates after each sample.
    covariance : ndarray (n, p, p) or None
        Covariance that the estimator reports after each sample.
    alarms : ndarray (n,) of bool
        True for each sample at which the estimator raised an alarm.
    """
    n, p, claims = len(y), len(estimator.names), hasattr(estimator, "covariance")
    theta, claimed, alarms = np.empty((n, p)), np.empty((n, p, p)), np.zeros(n, bool)
    if not (claims or hasattr(estimator, "alarm")):
        return run_estimator(estimator, u, y, valid), None, alarms
    for k in range(n):
        try:
            value = estimator.step(u[k], y[k] if valid is None or valid[k] else None)
            theta[k] = theta_of(value, estimator.names, estimator)
        except BaseException as error:
            error.at_sample = k  # type: ignore[attr-defined]  # for the message
            raise
        if claims:
            claimed[k] = estimator.covariance  # type: ignore[attr-defined]
        alarms[k] = getattr(estimator, "alarm", False)
    return theta, claimed if claims else None, alarms


def write_estimates(
    path: Path, times: Any, theta: Any, names: Sequence[str], about: Mapping[str, Any],
    **claimed: Array | None,
) -> None:  # fmt: skip
    """Write the times, the estimates and the reported covariances to a NetCDF-4 file.

    Parameters
    ----------
    path : Path
        File to write. The function creates the folder of the file if necessary.
    times : ndarray (N,)
        Time of each sample [s].
    theta : ndarray (N, p)
        Estimates.
    names : sequence of str
        Names of the p estimated parameters.
    about : mapping
        Global attributes of the NetCDF file.
    **claimed : ndarray or None
        Either ``covariance`` (N, p, p) or ``deviation`` (N, p): the covariances or the standard
        deviations that the estimator reports.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    import xarray

    dimensions = ("time", "estimate", "estimate_2")
    data: dict[str, Any] = {"theta": (dimensions[:2], theta, {"long_name": "estimates, SI units"})}
    for name, values in claimed.items():
        if values is not None:
            words = {"long_name": f"{name} that the estimator reports"}
            data[name] = (dimensions[: values.ndim], values, words)
    coords = {"time": ("time", times, {"units": "s"}), "estimate": np.array(names, object)}
    content = xarray.Dataset(data, coords, about).to_netcdf(engine="h5netcdf")
    make_folder(path.parent)
    with new_file(path) as part:  # if HDF5 wrote to a full disk, HDF5 would end the process
        part.write_bytes(content)
