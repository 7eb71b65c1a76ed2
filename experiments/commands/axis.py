"""The commands `import`, `identify` and `track` for the logs of a real axis."""

from pathlib import Path
from typing import Any

import flexaxis as fx
from flexaxis.experiments.commands.options import Args, answer, command
from flexaxis.experiments.files import check_file, check_not_input
from flexaxis.experiments.logs.options import READING, tables_of
from flexaxis.sim.errors import FlexaxisError


def _target(args: Args, default: str, *inputs: Any) -> Path:
    """Return the output path; raise an error if its suffix is wrong or the file is an input."""
    check_file(args.log)
    path = args.output or args.log.with_name(args.log.stem + default)
    check_not_input((args.log, args.map, *inputs), path, path.with_suffix(".html"))
    if path.suffix != Path(default).suffix:
        raise FlexaxisError(f"-o {path}: use a file name that ends in {Path(default).suffix}")
    return path


def _saved(args: Args, result: Any, path: Path) -> int:
    """Save a result and its report, print the result, and return the exit status of the command."""
    page = result.save(path)
    content = result.content | {"path": path, "report": page}
    return answer(args, content, result.status, result, path, f"report: {page}")


@command("log", "-o", *READING)
def import_(args: Args) -> int:
    """Convert a log of your own axis to a record, and check the data quality.

    LOG is a text table, or a file in MAT (all versions), HDF5 or NetCDF format. The command checks
    time stamps, gaps, angle wrapping, clipping, update rates, units, outliers, the type of the
    torque signal, and signs. For each problem, the command prints an option that solves it.

    example:
      flexaxis import log.csv --torque current --angle motor_pos --unit angle=deg -o rec.nc
      flexaxis import bench.mat --map bench.toml -o rec.nc
    """
    path = _target(args, "-imported.nc")
    result = fx.import_log(args.log, **tables_of(args))
    return _saved(args, result, path)


@command("log", "--model", "--free", "--fix", "--start", "--delay", "--friction",
         "--gravity", "--validate", "--covariate", "--false-alarms", "-o",
         *READING)  # fmt: skip
def identify(args: Args) -> int:
    """Identify the parameters of your axis from a log, a record, or a folder of logs.

    The command adds dry friction, gravity and similar effects to the model if these effects improve
    the simulation of held-out log segments. The log of a single axis determines all parameters only
    relative to k_T. Therefore the command identifies neither k_T nor the gear ratio r, unless you
    use --free. The exit status is 1 if the estimates are less accurate than their standard
    deviations indicate, else 0.

    For a folder, the command reads all logs, sorted by file name, and writes a CSV file with one
    row of estimates per log. The report shows the effects of the covariates (--covariate), and all
    parameter changes. For a folder, the exit status is 1 if a parameter changed, or if the command
    could not use one of the logs.

    MODEL is one_mass, two_mass, three_mass, or the path of your own TOML file (docs/logs.md).

    example:
      flexaxis identify rec.nc --model two_mass -o axis.toml
      flexaxis identify rec.nc --model two_mass --friction coulomb --validate tuesday.nc
      flexaxis identify log.csv --torque current --angle phi --fix k_T=0.6 --fix f_l=0.01
      flexaxis identify rec.nc --model my_axis.toml --free J_m,k --json
      flexaxis identify days/ --model axis.toml --covariate temp
    """
    from rich.console import Console

    ending = "-estimates.csv" if args.log.is_dir() else "-axis.toml"
    path = _target(args, ending, args.model, args.validate)
    options = {
        name: getattr(args, name)
        for name in ("free", "delay", "friction", "gravity", "validate", "false_alarms")
    }
    with Console(stderr=True, quiet=args.quiet).status(f"identifying {args.model}"):
        result = fx.identify(
            args.log, args.model, start=dict(args.start), fix=dict(args.fix),
            covariates=args.covariate, columns=tables_of(args), **options,
        )  # fmt: skip
    return _saved(args, result, path)


@command("log", "--model", "--identify", "--estimator", "--start", "-o", *READING)
def track(args: Args) -> int:
    """Track parameters in a log of your axis, and report parameter changes.

    AXIS.toml is an axis file from `flexaxis identify`. The command writes the estimates to a NetCDF
    file. The report shows residuals, alarms, parameter changes and drifts. The exit status is 1 if
    a parameter changed, or if the log does not match the axis, for example because of a wrong unit
    or sign.

    example:
      flexaxis track rec.nc --model axis.toml --identify k_T --identify 1/J_l --identify k
      flexaxis track rec.nc --model axis.toml --identify k --estimator rpem-forgetting
      flexaxis track rec.nc --model axis.toml --identify f_m --estimator glr
      flexaxis track rec.nc --model axis.toml --identify k_T --start 1.2 --json
    """
    code = (args.estimator or "").partition(":")[0]
    path = _target(args, "-track.nc", args.model, code)
    names = list(dict.fromkeys(args.identify))
    result = fx.track(args.log, args.model, names, args.estimator, start=args.start,
                      columns=tables_of(args))  # fmt: skip
    return _saved(args, result, path)
