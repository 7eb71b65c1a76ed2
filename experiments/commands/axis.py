"""Commands for logs of a real axis: import, identify, track, trend."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import flexaxis as fx
from flexaxis.experiments.commands.options import Args, answer, command
from flexaxis.experiments.files import REPORT, check_file, check_not_input, write_json
from flexaxis.experiments.logs.options import READING, assignments, tables_of


def _target(args: Args, default: str, *inputs: Any) -> Path:
    """Return the path to write; refuse one that is an input or was not written by flexaxis."""
    from flexaxis.experiments.logs.files import require_suffix, spare_foreign

    check_file(args.log)
    path = args.output or args.log.with_name(args.log.stem + default)
    check_not_input((args.log, args.map, *inputs), path, path.with_suffix(".html"))
    require_suffix(path, Path(default).suffix, "the result")
    spare_foreign(path, path.with_suffix(".html"))
    return path


def _saved(args: Args, result: Any, path: Path, status: int) -> int:
    """Save the result and its page, and print them."""
    page = result.save(path)
    content = result.content | {"path": path, "report": page}
    return answer(args, content, status, result, path, f"report: {page}")


@command("your own axis", "log", "-o", "--strict", *READING)
def import_(args: Args) -> int:
    """Make a record of your own log, and check whether it is plausible.

    LOG is a table of text, MAT (all versions), HDF5, NetCDF or Parquet. The checks say what spoils
    estimates before any estimator runs, and what to type against it: time stamps and gaps,
    wrapping, clipping, clocks, units, outliers, the kind of torque, signs, dry friction.

    example:
      flexaxis import log.csv --torque current --angle motor_pos --unit angle=deg -o rec.nc
      flexaxis import bench.mat --map bench.toml -o rec.nc
    """
    from flexaxis.experiments.logs.files import record_beside

    args.output = args.output or record_beside(args.log)
    path = _target(args, ".nc")
    result = fx.import_log(args.log, command=args.line, **tables_of(args))
    spoilt = "problem" in [check["verdict"] for check in result.content["checks"]]
    return _saved(args, result, path, int(args.strict and spoilt))


@command("your own axis", "log", "--model", "--free", "--fix", "--start", "--delay", "--friction",
         "--gravity", "--highpass", "--validate", "-o", *READING)  # fmt: skip
def identify(args: Args) -> int:
    """Identify the nominal values of your axis from a log or a record.

    Three fits are made: whitened prediction errors, white ones, and for a rigid axis its inverse
    dynamics. The one that best simulates held-out pieces of the log is taken, and if they differ
    by more than they claim, deviations are widened to that. Dry friction, gravity and friction with
    two sides are taken if such simulations are better with them. A log of one axis shows ratios to
    k_T only, so k_T (and the gear ratio r) stay at their values unless freed. Status 0: the numbers
    can be used as far as their deviations say; 1: they cannot.

    MODEL is one_mass, two_mass, three_mass, or a TOML of your own (docs/logs.md).

    example:
      flexaxis identify rec.nc --model two_mass -o axis.toml
      flexaxis identify rec.nc --model two_mass --friction coulomb --validate tuesday.nc
      flexaxis identify log.csv --torque current --angle phi --fix k_T=0.6 --fix f_l=0.01
      flexaxis identify rec.nc --model my_axis.toml --free J_m --free k --json
    """
    path = _target(args, "-axis.toml", args.model, args.validate)
    options = {name: getattr(args, name) for name in
               ("free", "delay", "friction", "gravity", "highpass", "validate")}  # fmt: skip
    result = fx.identify(
        args.log, args.model, start=assignments("start", args.start),
        fix=assignments("fix", args.fix), columns=tables_of(args), command=args.line, **options,
    )  # fmt: skip
    return _saved(args, result, path, result.status)


@command("your own axis", "log", "--model", "--identify", "--estimator", "--start", "-o", *READING)
def track(args: Args) -> int:
    """Run an estimator over a log of your axis: estimates, residuals, changes, alarms.

    AXIS.toml is what `flexaxis identify` wrote. The estimates go to a NetCDF file, and a report
    says which parameter changed and when. If the log has a load angle, it is predicted from the
    motor angle and compared. Status 1 if a change was found, or if the log does not fit the axis:
    another unit or sign, or another axis.

    example:
      flexaxis track rec.nc --model axis.toml --identify k_T --identify 1/J_l --identify k
      flexaxis track rec.nc --model axis.toml --identify k --estimator rpem-forgetting
      flexaxis track rec.nc --model axis.toml --identify f_m --estimator glr
      flexaxis track rec.nc --model axis.toml --identify k_T --start 1.2 --json
    """
    code = (args.estimator or "").partition(":")[0]
    path = _target(args, "-track.nc", args.model, code)
    names = list(dict.fromkeys(",".join(args.identify).split(",")))
    result = fx.track(args.log, args.model, names, args.estimator, start=args.start,
                      columns=tables_of(args), command=args.line)  # fmt: skip
    return _saved(args, result, path, result.status)


@command("your own axis", "logs", "--model", "--covariate", "--free", "--false-alarms",
         "--smallest", "--jobs", "-o", *READING)  # fmt: skip
def trend(args: Args) -> int:
    """Follow the parameters of your axis over many logs, and tell wear from warmth.

    Each log gives estimates with intervals, from the values of AXIS.toml on; the page shows each
    parameter from log to log, when it changed, and what a covariate such as the temperature
    explains. Dates are read from the logs or their names, else the logs are numbered. A log is
    computed once: the same line only computes what is new. Status 1 if something changed, or a log
    is not like the others.

    example:
      flexaxis trend days/ --model axis.toml --covariate temp -o trend/
      flexaxis trend monday.csv tuesday.csv --model axis.toml --map bench.toml --free f_m
      flexaxis trend days/ --model axis.toml --covariate temperatures.csv --jobs 4 --json
    """
    from flexaxis.experiments.logs.axis_file import find_axis
    from flexaxis.experiments.logs.findings import MARKS
    from flexaxis.experiments.logs.pages.page import write_page
    from flexaxis.experiments.logs.pages.trend_page import trend_page
    from flexaxis.experiments.logs.trend.estimates import RESULT, Source
    from flexaxis.experiments.logs.trend.trend import ailments, trend_of
    from flexaxis.experiments.logs.trend.words import remarks, summary

    columns, folder = tables_of(args), args.output or Path("trend")
    treated = {name: columns.pop(name, None) for name in ("resample", "burn_in")}
    found = trend_of(
        args.logs, find_axis(args.model), Source(columns, treated), folder, free=args.free,
        covariates=args.covariate, false_alarms=args.false_alarms, smallest=args.smallest / 100,
        jobs=args.jobs,
    )  # fmt: skip
    page = trend_page(found, title=f"Trend over {len(found.good)} logs", command=args.line)
    write_page(page, folder / REPORT)
    content = {
        "parameters": {one.name: summary(one, found) for one in found.verdicts},
        "logs": len(found.rows),
        "problems": {row["log"]: row["problem"] for row in found.rows if row["problem"]},
        "unlike_the_others": ailments(found.rows),
    }
    write_json(folder / RESULT, content)
    lines = [f"{MARKS[each.kind]} {each.text}" for each in remarks(found)]
    status = int(bool(found.changed or content["unlike_the_others"]))
    return answer(args, content | {"report": folder / REPORT}, status, *lines, folder / REPORT)
