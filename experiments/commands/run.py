"""The commands `run`, `study`, `report`, `rerun`, `simulate` and `estimate`."""

from pathlib import Path
from typing import Any

import flexaxis as fx
from flexaxis.experiments.commands.options import Args, answer, command
from flexaxis.experiments.files import REPORT, check_file, check_not_input, summary_of
from flexaxis.sim.errors import FlexaxisError

ENGINE = ("-o", "--jobs", "--dask", "--shard", "--overwrite", "--time-limit")


def work(args: Args) -> dict[str, Any]:
    """Return the options that control how runs are executed, as arguments of `fx.benchmark`."""
    names = ("jobs", "dask", "shard", "overwrite", "time_limit")
    return {name: getattr(args, name) for name in names if name in args}


@command("names", "--estimator", "--seeds", "--from", *ENGINE)
def run(args: Args) -> int:
    r"""Run estimators on scenarios with many random seeds, and write a report with the scores.

    SUITE and SCENARIO are names from `flexaxis list`, or paths of TOML files. Without --estimator,
    the command runs the estimators of the suite. If you name neither a suite nor an estimator, the
    command runs the estimators of the suite 'smoke'. The output folder contains scores.sqlite and
    scores.csv (one row per scenario, estimator, seed and parameter), summary.json and report.html.
    The command executes the code of your own estimators.

    A case is one run of one estimator on one record. The command stores the result of each case
    immediately. Repeat the command to resume a benchmark after Ctrl-C or a full disk. The command
    skips finished cases. If a case fails, the command stores the error message and continues with
    the next case. If any case failed, the exit status is 1, or 70 if the estimator code crashed.

    example:
      flexaxis run smoke
      flexaxis run fm_step kt_step --estimator rpem-forgetting \
               --estimator 'rpem-forgetting[forgetting=0.99]' --seeds 30 -o results/lambda
      flexaxis run mine.toml --estimator my_estimator.py:Mine --seeds 0:20
      flexaxis run --from shard1 shard2 -o results/whole
    """
    if args.shards:
        if args.output is None:
            raise FlexaxisError("--from needs an output folder for the merged results: add -o DIR")
        check_not_input(args.shards, args.output)
        fx.merge(args.shards, args.output, jobs=args.jobs, overwrite=args.overwrite)
        return _results(args, fx.load(args.output))
    if not args.names:
        raise FlexaxisError("name a scenario, or a suite such as 'smoke' (see `flexaxis list`)")
    fx.check_names(args.names)
    folder = args.output or Path("results", Path(args.names[0]).stem)
    check_not_input(args.names, folder)
    results = fx.benchmark(
        args.estimator, scenarios=args.names, seeds=args.seeds, folder=folder,
        **work(args),
    )  # fmt: skip
    return _results(args, results)


@command("file", "--dry-run", *ENGINE)
def study(args: Args) -> int:
    r"""Run a study, which varies settings of scenarios, faults and estimators.

    STUDY.toml specifies scenarios, estimators, random seeds, and the values of each swept setting:

      scenario = "fm_step"
      estimators = ["rpem-forgetting", "glr"]
      seeds = 60
      [sweep]
      "fault[0].factor" = [1.1, 1.5, 2.0, 3.0]      # a key of the scenario or of its faults
      "rpem-forgetting.forgetting" = [0.99, 0.995]  # an option (of every estimator: "estimator.X")

    A case is one run of one estimator on one record. The command stores the result of each case
    immediately. If you repeat the command, it skips finished cases, even if you have added
    estimators, seeds or values to STUDY.toml. If a case fails, the command stores the error
    message. If any case failed, the exit status is 1, or 70 if the estimator code crashed. The
    command executes the code of the estimators in the study file, so use only files that you trust.
    With --dry-run, the command executes no estimator code.

    example:
      flexaxis study docs/examples/friction_steps.toml --dry-run
      flexaxis study docs/examples/friction_steps.toml -o results/friction --jobs 4
      flexaxis study docs/examples/friction_steps.toml -o /net/friction3 --shard 3/100
      flexaxis run --from /net/friction* -o results/friction
    """
    check_file(args.file)
    folder = args.output or Path("results", args.file.stem)
    check_not_input([args.file], args.output)
    if args.dry_run:
        known = fx.plan(args.file)
        lines = [", ".join(f"{key} = {value}" for key, value in each.items())
                 for each in known["variants"]]  # fmt: skip
        words = (
            f"{len(lines)} variants, {known['cases']} cases: about "
            f"{known['seconds'] / args.jobs / 60:.2g} min on {args.jobs} processes (not counting "
            f"your own estimators), and {known['megabytes']:.1f} MB in {folder}"
        )
        return answer(args, known, 0, *lines, words)
    return _results(args, fx.study(args.file, folder=folder, **work(args)))


def _results(args: Args, results: Any) -> int:
    """Print the scores, the failures and the path of the report, and return the exit status."""
    from flexaxis.experiments.reporting.terminal import run_text

    whole, lines = args.shard == (1, 1), results.problems
    missing, path = results.missing * whole, results.folder / (REPORT * whole)
    lines += [
        f"{missing} cases are missing, because no shard contains them: run the missing shards, "
        "and merge all shards again"
    ] * bool(missing)
    crashed = results.failures["error"].str.startswith("EstimatorCrash").any()
    status = 70 if crashed else int(bool(lines))
    content, text = {"rows": results.pooled()}, results
    if whole and not results.axes:
        content = summary_of(results.folder)
        text = run_text(content)
    content |= {"report": path, "cases": results.cases, "missing": missing}
    return answer(args, content, status, *[text] * whole, *lines, f"report: {path}")


@command("folder")
def report(args: Args) -> int:
    """Write report.html again from the stored results of a run or a study.

    example:
      flexaxis report results/smoke
    """
    path = fx.load(args.folder).report()
    return answer(args, {"report": path}, 0, f"report: {path}")


@command("folder", "--sample", "--jobs", "--time-limit")
def rerun(args: Args) -> int:
    """Repeat the runs in a results folder, and compare the new scores with the stored scores.

    Use this command to check your own results, or those of someone else. The command does not
    change the results folder. The command executes the code of your own estimators, whose files
    must still be at their original paths.

    exit status: 0 if the new scores differ from the stored scores by at most 1e-6 (relative
    difference), else 1

    example:
      flexaxis rerun results/smoke --sample 20
      flexaxis rerun results/friction
    """
    rows = fx.load(args.folder).rerun(args.sample, **work(args))
    worst = rows.loc[rows["difference"].idxmax()].to_dict()
    text = "{difference:.1g} ({score} of {parameter} for {estimator} on {scenario}, seed {seed})"
    words = f"{len(rows)} rows compared: the largest relative difference is {text.format(**worst)}."
    status = int(worst["difference"] > 1e-6)  # rounding differs between computers
    return answer(args, {"rows": rows.to_dict("records"), "worst": worst}, status, words)


@command("scenario", "--seed", "-o", "--as-log", "--units", "--gaps", "--counts")
def simulate(args: Args) -> int:
    """Simulate a scenario, and save the measured signals and the true parameter values.

    With --as-log, the command writes a log that resembles the log of a real robot. A simulated log
    contains no true parameter values, but can contain gaps and non-SI units. Use simulated logs to
    practise the commands `import` and `identify`.

    example:
      flexaxis simulate fm_step --seed 0 -o rec.nc
      flexaxis simulate coulomb_fm_step --as-log csv --units deg,A,ms --counts 65536 -o log.csv
      flexaxis simulate moves_fm_step --as-log csv --gaps 3 -o log.csv
    """
    fx.check_names([args.scenario])
    style = {"units": [*filter(None, args.units.split(","))], "gaps": args.gaps,
             "counts": args.counts or 0}  # fmt: skip
    ending = args.as_log or "nc"
    path = args.output or Path(f"{Path(args.scenario).stem}-{args.seed}.{ending}")
    if any(style.values()) and not args.as_log:
        raise FlexaxisError("--units, --gaps and --counts apply only to logs: add --as-log")
    if path.suffix != f".{ending}":
        raise FlexaxisError(f"-o {path}: use a file name that ends in .{ending}")
    check_not_input([args.scenario], path)
    record = fx.simulate(args.scenario, seed=args.seed)
    content = {"path": path, "hash": record.hash}
    if not args.as_log:
        record.save(path)
        return answer(args, content, 0, path)
    record.save_log(path, **style)
    line = f"flexaxis import '{path}' --torque-is held"
    return answer(args, content | {"import": line}, 0, f"To import this log: {line}", path)


@command("record", "--estimator", "-o")
def estimate(args: Args) -> int:
    """Run an estimator on a record, and save the estimates as functions of time.

    The scenario in the record defines the nominal parameters, the sampling period, the parameters
    to estimate, and the signal that the estimator reads.

    example:
      flexaxis estimate rec.nc --estimator rpem-forgetting -o est.nc
      flexaxis estimate rec.nc --estimator 'rpem-forgetting[forgetting=0.99, regularization=1.0]'
      flexaxis estimate rec.nc --estimator my_estimator.py:Mine        (runs the code in that file)
    """
    check_file(args.record)
    path = args.output or args.record.with_name(args.record.stem + "-estimates.nc")
    code = args.estimator.partition(":")[0]
    check_not_input((args.record, code), path)
    result = fx.estimate(args.record, args.estimator)
    result.save(path)
    errors = result.table["error [%]"].dropna()
    words = ", ".join(f"{name} {error:+.2f} %" for name, error in errors.items())
    content = {"path": path, "estimator": result.estimator, **result.table.to_dict()}
    end = f"Final error of {result.estimator}: {words or 'unknown (no true values in the record)'}."
    return answer(args, content, 0, result.table, end, path)
