"""The commands `compare`, `tune`, `check` and `new` for the evaluation of estimators."""

from pathlib import Path

import flexaxis as fx
from flexaxis.experiments.commands.options import Args, answer, command
from flexaxis.experiments.commands.run import work
from flexaxis.experiments.files import check_not_input
from flexaxis.sim.errors import FlexaxisError


@command("names", "--base", "--candidate", "--seeds", "--max-seeds", "--margin",
         "--match-std", "--strict", "-o", "--jobs", "--overwrite", "--time-limit")  # fmt: skip
def compare(args: Args) -> int:
    r"""Test whether one estimator is better or worse than another, and report a verdict.

    Both estimators run on the same records, and the command compares their scores for each seed. If
    you name the folders of two finished runs, the command compares the scores for all seeds that
    both runs contain. Both runs must have used the same scenarios and software versions. The page
    docs/gate.md explains the statistics.

    With --match-std, the command tunes both estimators to the noise of rpem-forgetting, and
    compares only their lags. With --match-std, both estimators need a tuning parameter
    (docs/scores.md).

    exit status: 0 no regression; 1 worse; 2 wrong use; 3 undecided; 70 a crash. Without --strict,
    the status of an undecided verdict is 0, unless the candidate has missing runs, more failed runs
    than the base, or at least two more runs that diverge or never settle.

    example:
      flexaxis compare --base old.py:Mine --candidate new.py:Mine
      flexaxis compare --base rpem-forgetting --candidate 'pipe:octave-cli -q my.m' fm_step \
                       --max-seeds 128 --margin lag=5%,std=5%
      flexaxis compare --base glr --match-std --candidate new.py:Mine fm_step
      flexaxis compare results/old results/new
    """
    folder = args.output or Path("results/compare")
    runs = args.names if args.names and all(Path(name).is_dir() for name in args.names) else []
    check_not_input(args.names, folder)
    if not runs:
        if not (args.base and args.candidate):
            raise FlexaxisError(
                "name the estimators with --base E --candidate E, as in `flexaxis compare --base "
                "rpem-forgetting --candidate glr fm_step`, or name two existing folders of "
                "finished runs"
            )
        fx.check_names(args.names)
    elif len(runs) != 2 or args.match_std or args.max_seeds:
        raise FlexaxisError(
            "to compare finished runs, name two folders, and omit --match-std and --max-seeds, "
            "which need new runs"
        )
    margins = {}
    for text in filter(None, args.margin.split(",")):
        score, _, share = text.partition("=")
        try:
            margins[score.strip()] = float(share.removesuffix("%")) / 100
        except ValueError:
            raise FlexaxisError(f"--margin {text}: write a percentage, as in lag=2%") from None
    result = fx.compare(
        args.base, args.candidate, scenarios=args.names or "gate", runs=runs,
        seeds=args.seeds, max_seeds=args.max_seeds, match_std=args.match_std, margins=margins,
        folder=folder, **work(args),
    )  # fmt: skip
    status = 3 if args.strict and result.verdict == "undecided" else result.status
    return answer(args, result.content, status, result, f"report: {result.content['report']}")


@command("estimators", "--sweep", "--seeds", "--save", "-o", "--jobs",
         "--overwrite", "--time-limit")  # fmt: skip
def tune(args: Args) -> int:
    r"""Tune estimators to the noise level of the reference estimator.

    The reference estimator is rpem-forgetting with default settings. Each estimator starts at the
    true parameters, and runs on the nominal axis without a fault. The noise measure is the excess
    prediction error, which combines all parameters in one number. The command tries at most 12
    values of the tuning parameter, from 1/1024 to 1024 times its default.

    With --sweep, the command does not tune the estimators, but runs each of them with several
    settings on a scenario with a fault. With --sweep, the command prints the lag and noise for each
    setting, and draws a figure. The command also prints the lag of each estimator at the noise
    level of the reference estimator.

    example:
      flexaxis tune ekf
      flexaxis tune ekf glr --sweep fm_step
      flexaxis tune --save estimators/tuned.toml
    """
    folder = args.output or Path("results/tune")
    table = fx.tune(
        *args.estimators, sweep=args.sweep, seeds=args.seeds or "0:16", folder=folder,
        file=args.save, **work(args),
    )  # fmt: skip
    if args.sweep:
        table.plot().savefig(figure := folder / "sweep.svg")
        return answer(args, table.content | {"figure": figure}, 0, table, f"figure: {figure}")
    match = (
        "{setting} is as noisy as rpem-forgetting: the ratio of their {match} scores is "
        "{ratio:.3f}."
    )
    rows = table.to_dict("records")
    lines = [("{estimator} is not tuned: {problem}" if row["problem"] else match).format(**row)
             for row in rows]  # fmt: skip
    return answer(args, {"rows": rows}, int(any(table["problem"])), *lines)


@command("estimator")
def check(args: Args) -> int:
    """Check whether an estimator follows the rules that are necessary for valid scores.

    The rules concern array shapes, finite numbers, the agreement of `step` and `run`, causality,
    data gaps and other properties. For each broken rule, the command prints the reason for the rule
    and suggests a correction. The command executes the estimator code.

    exit status: 0 all rules hold, 1 a rule is broken, 2 the estimator cannot be created, 70 the
    constructor of the estimator crashed

    example:
      flexaxis check my_estimator.py:Mine
      flexaxis check 'pipe:octave-cli -q my.m'
    """
    rules, lines = fx.check(args.estimator).to_dict("records"), []
    words = {True: "holds", False: "BROKEN", None: "not applicable"}
    for each in rules:
        lines.append(f"{each['rule']:<24} {words[each['holds']]:<15} {each['seen']}")
    broken = [each for each in rules if each["holds"] is False]
    lines += [f"\n{each['rule']}: {each['reason']}\n  hint: {each['hint']}" for each in broken]
    lines += [f"{len(broken)} of {len(rules)} rules are broken." if broken else "All rules hold."]
    return answer(args, {"rules": rules}, int(bool(broken)), *lines)


@command("path")
def new(args: Args) -> int:
    """Write a template for your own estimator. The template is already a working estimator.

    In Python, the template is a class. In C and GNU Octave, the template is a program that
    communicates through a pipe. The page docs/pipes.md describes the pipe protocol, which works
    with any programming language.

    example:
      flexaxis new my_estimator.py
      flexaxis check my_estimator.py:Mine
      cp my_estimator.py old.py   # before a change
      flexaxis compare --base old.py:Mine --candidate my_estimator.py:Mine fm_step
      flexaxis new my_estimator.c
    """
    lines = fx.new(args.path)
    words = f"The template {args.path} estimates the motor friction f_m. Change the code, then run:"
    return answer(args, {"path": args.path, "next": lines}, 0, words, *(f"  {x}" for x in lines))
