"""The commands `list`, `show`, `demo` and `paper`."""

from collections import Counter
from itertools import chain
from pathlib import Path

import flexaxis as fx
from flexaxis.experiments.commands.options import Args, answer, command

MOST = 60  # largest number of lines that `list` prints without --all


@command("kind", "--group", "--find", "--all")
def list_(args: Args) -> int:
    """List scenarios, suites, estimators, and the scenarios for each physical fault.

    example:
      flexaxis list
      flexaxis list faults
      flexaxis list --group steps
      flexaxis list --find friction --json
    """
    if not (args.kind or args.group or args.find or args.json or args.all):
        groups = Counter(line["group"] for line in fx.scenarios())
        lines = [f"  {name:<14}{groups[name]:>3}  {words}" for name, words in fx.GROUPS.items()]
        suites = f"suites: {', '.join(suite['name'] for suite in fx.suites())}"
        more = "more: flexaxis list estimators | faults | --group steps | --find friction | --all"
        return answer(args, {}, 0, suites, "groups of scenarios:", *lines, more)
    content = {
        "scenarios": fx.scenarios(group=args.group, find=args.find),
        "suites": fx.suites(args.find),
        "estimators": fx.estimators(find=args.find),  # type: ignore[operator]
        "faults": fx.faults(args.find),
    }
    if kind := args.kind or (args.group and "scenarios"):
        content = {kind: content[kind]}
    rows = [[text for key, text in row.items() if key not in {"faults", "group"}]
            for row in chain(*content.values())]  # fmt: skip
    width = max((len(name) for name, *_ in rows), default=0)
    lines = [f"{name:<{width}} {' '.join(middle):<6} {text}" for name, *middle, text in rows]
    lines = lines or [f"no entry contains {args.find!r}"]
    if len(lines) > MOST and not args.all:
        lines[MOST:] = [f"… {len(lines) - MOST} more lines: add --all to print them"]
    return answer(args, content, 0, *lines)


@command("name")
def show(args: Args) -> int:
    """Show all settings of a scenario, a suite or an estimator.

    For a scenario, the command prints a description and the TOML text, which you can edit and run.
    For an estimator, the command prints the meaning and the default value of each option.

    example:
      flexaxis show fm_step
      flexaxis show fm_step > mine.toml       then: flexaxis run mine.toml
      flexaxis show glr
    """
    content, lines = fx.show(args.name)
    return answer(args, content, 0, *lines)


@command("lesson", "--estimator", "--seed", "--port", "--no-browser")
def demo(args: Args) -> int:
    """Inject faults into a live axis in the browser, and watch which estimator detects them first.

    Estimator A is the method of Östring and Gunnarsson, and estimator B is the recommended
    estimator. Press the button "motor friction f_m × 2" to inject a fault. After a fault, the
    diagram on the right shows the estimation errors of A and B, and the theoretical lower limit of
    the error. You can pause the axis, simulate single steps, and choose other estimators. You can
    also change the forgetting factor λ, the drift Δ, the regularisation μ, the noise and the dry
    friction.

    The demo page needs no network, and opens only on this computer. The page docs/demo.md explains
    how to show the demo to a class.

    example:
      flexaxis demo
      flexaxis demo --estimator rpem-drift --estimator ekf
      flexaxis demo flexaxis_lesson.toml
    """
    fx.serve(
        args.estimator or (), lesson=args.lesson, seed=args.seed, port=args.port,
        browser=not args.no_browser,
    )  # fmt: skip
    return 0


@command("-o")
def paper(args: Args) -> int:
    """Reproduce the figures of Östring and Gunnarsson's paper, and check the paper's claims.

    The paper is "Recursive identification of physical parameters in a flexible robot arm" by
    Östring and Gunnarsson. The command writes index.html, claims.json, and fig3 to fig9 (.svg,
    .png) to the output folder. The exit status is 1 if any of the claims does not hold.

    example:
      flexaxis paper -o results/paper
    """
    claims, page = fx.reproduce(args.output or Path("results/paper"))
    lines = [f"{'✓' if claim['holds'] else '✗'} {claim['claim']}" for claim in claims]
    holds = sum(claim["holds"] for claim in claims)
    lines += [f"{holds} of {len(claims)} claims hold"]
    return answer(args, {"claims": claims, "page": page}, int(holds < len(claims)), *lines, page)
