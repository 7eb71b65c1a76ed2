"""Commands to look and to teach: list, show, demo, paper."""

from collections import Counter
from dataclasses import asdict
from itertools import chain
from pathlib import Path

import flexaxis as fx
from flexaxis.experiments.catalogue import find as catalogue
from flexaxis.experiments.catalogue.find import GROUPS
from flexaxis.experiments.commands.options import Args, answer, command

MOST = 60  # lines that `list` prints


@command("kind", "--group", "--find", "--all")
def list_(args: Args) -> int:
    """List scenarios, suites, estimators, and the scenario for each physical fault.

    example:
      flexaxis list
      flexaxis list faults
      flexaxis list --group steps
      flexaxis list --find friction --json
    """
    if not (args.kind or args.group or args.find or args.json or args.all):
        groups = Counter(line["group"] for line in fx.scenarios())
        lines = [f"  {name:<14}{groups[name]:>3}  {words}" for name, words in GROUPS.items()]
        suites = f"suites: {', '.join(catalogue.suite_names())}"
        more = "more: flexaxis list estimators | faults | --group steps | --find friction | --all"
        return answer(args, {}, 0, suites, "groups of scenarios:", *lines, more)
    content = {
        "scenarios": fx.scenarios(group=args.group, find=args.find),
        "suites": catalogue.suites(args.find),
        "estimators": fx.estimators(find=args.find),  # type: ignore[operator]
        "faults": catalogue.faults(args.find),
    }
    if kind := args.kind or (args.group and "scenarios"):
        content = {kind: content[kind]}
    rows, lines = list(chain(*content.values())), []
    names = [next(iter(row.values())) for row in rows]
    for name, row in zip(names, rows, strict=True):
        *middle, text = (row[key] for key in [*row][1:] if key not in {"faults", "group"})
        lines.append(f"{name:<{max(map(len, names))}} {' '.join(middle):<6} {text}")
    if not lines:
        lines = [f"nothing has {args.find!r}"]
    if len(lines) > MOST and not args.all:
        lines[MOST:] = [f"… {len(lines) - MOST} more: add --all"]
    return answer(args, content, 0, *lines)


@command("name")
def show(args: Args) -> int:
    """Show a scenario, a suite or an estimator with all its values.

    A scenario is printed as a description and as TOML, which you can edit and run. An estimator is
    printed with the meaning and default of each option.

    example:
      flexaxis show fm_step
      flexaxis show fm_step > mine.toml       then: flexaxis run mine.toml
      flexaxis show glr
    """
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments.catalogue import card

    if args.name in REGISTRY:
        summary, options = REGISTRY[args.name].summary, card.options(REGISTRY[args.name])
        content = {"name": args.name, "summary": summary, "options": options}
        lines = [f"{name} = {default}\n    {text}" for name, (default, text) in options.items()]
        return answer(args, content, 0, f"{args.name}: {summary}", *lines)
    if args.name in catalogue.suite_names():
        content = asdict(catalogue.find_suite(args.name))
        return answer(args, content, 0, *(f"{key}: {value}" for key, value in content.items()))
    scenario = catalogue.find_scenario(args.name)
    known = card.reference_card(scenario) | {"content hash": scenario.hash}
    lines = [f"# {key}: {' '.join(value.split())}" for key, value in known.items()]
    content = scenario.resolved() | {"hash": scenario.hash}
    return answer(args, content, 0, *lines, "", scenario.to_toml().rstrip())


@command("lesson", "--estimator", "--seed", "--port", "--no-browser")
def demo(args: Args) -> int:
    """Inject faults into a live axis in the browser, and watch which estimator detects them first.

    Estimator A is the paper's method, B the recommended one. Press "motor friction f_m × 2": the
    diagram on the right shows the remaining error of both, and the theoretical limit. Pause and
    step through the fault, change λ, Δ, μ, noise and dry friction, or choose other estimators.

    The page needs no network and is served on this computer only; docs/demo.md explains how to
    show it to a class.

    example:
      flexaxis demo
      flexaxis demo --estimator rpem-drift --estimator ekf
      flexaxis demo flexaxis_lesson.toml
    """
    from flexaxis.experiments.demo.serve import serve

    serve(
        args.estimator or (), lesson=args.lesson, seed=args.seed, port=args.port,
        browser=not args.no_browser,
    )  # fmt: skip
    return 0


@command("-o")
def paper(args: Args) -> int:
    """Reproduce the paper's figures and check its claims.

    The folder gets index.html, claims.json, and fig3 to fig9 as .svg and .png. Exit status 1 if a
    claim does not hold.

    example:
      flexaxis paper -o results/paper
    """
    from flexaxis.experiments.paper.reproduce import PAGE, reproduce
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.progress import progress

    folder, store = args.output or Path("results/paper"), default_cache()
    with progress("paper", 1) as advance:
        claims = reproduce(folder, command=args.line, store=store, advance=advance)
    lines = [f"{'✓' if claim['holds'] else '✗'} {claim['claim']}" for claim in claims]
    holds = sum(claim["holds"] for claim in claims)
    content = {"claims": claims, "page": folder / PAGE}
    words = f"{holds} of {len(claims)} claims hold"
    return answer(args, content, int(holds < len(claims)), *lines, words, folder / PAGE)
