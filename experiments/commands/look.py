"""Commands to look and to teach: list, show, demo, paper."""

from __future__ import annotations

import os
import sys
from dataclasses import asdict
from pathlib import Path
from shutil import get_terminal_size

import flexaxis as fx
from flexaxis.experiments.catalogue import find as catalogue
from flexaxis.experiments.commands.options import Args, answer, command
from flexaxis.experiments.files import check_not_input
from flexaxis.sim.errors import FlexaxisError

MOST = 60  # lines that `list` prints


@command("look", "kind", "--group", "--find", "--all")
def list_(args: Args) -> int:
    """List scenarios, suites, estimators, and the scenario for each physical fault.

    example:
      flexaxis list
      flexaxis list faults
      flexaxis list --group steps
      flexaxis list --find friction --json
    """
    kinds = {
        "scenarios": lambda: fx.scenarios(group=args.group, find=args.find),
        "suites": lambda: catalogue.suites(args.find),
        "estimators": lambda: fx.estimators(find=args.find),
        "faults": lambda: catalogue.faults(args.find),
    }
    kind = args.kind or ("scenarios" if args.group else None)
    if not (kind or args.find or args.json or args.all):
        lines = [f"{'suites':<14} {', '.join(catalogue.suite_names())}", "", "groups of scenarios:"]
        groups = [line["group"] for line in fx.scenarios()]
        lines += [f"  {name:<14}{groups.count(name):>3}  {words}"
                  for name, words in catalogue.GROUPS.items()]  # fmt: skip
        more = "more: flexaxis list estimators | faults | --group steps | --find friction | --all"
        return answer(args, {}, 0, *lines, "", more)
    found = {each: make() for each, make in kinds.items() if kind in (each, None)}
    width = get_terminal_size().columns if sys.stdout.isatty() else 160
    lines = []
    for rows in found.values():
        for row in rows:
            name, *middle, text = [row[key] for key in row if key not in {"faults", "group"}]
            line = f"{name:<44} {' '.join(middle):<6}  {' '.join(text.split())}"
            lines.append(line[:width])
    shown = lines if args.all else lines[:MOST]
    rest = [f"… {len(lines) - MOST} more: add --all"] * (len(lines) > len(shown))
    return answer(args, found, 0, *shown, *rest, *([f"nothing has {args.find!r}"] * (not lines)))


@command("look", "name")
def show(args: Args) -> int:
    """Show a scenario, a suite or an estimator with all its values.

    A scenario is printed as its reference card and as TOML that can be edited and run from its
    path; an estimator with the meaning and the default of each option.

    example:
      flexaxis show fm_step
      flexaxis show fm_step > mine.toml       then: flexaxis run mine.toml
      flexaxis show glr
    """
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments.catalogue import card

    if args.name in REGISTRY:
        entry = REGISTRY[args.name]
        content = {"name": entry.name, "summary": entry.summary, "options": card.options(entry)}
        knob = entry.turning and entry.turning.label
        lines = [f"{entry.name}: {entry.summary}", "", "options:"]
        for name, (default, text) in card.options(entry).items():
            lines.append(f"  {name} = {default}\n      {text}")
        lines.append(f"\ntuning parameter: {knob or 'none'}")
        if entry.tuning:
            lines.append(f"  its default is tuned for {entry.tuning.axis}")
        return answer(args, content | {"knob": knob}, 0, *lines)
    if args.name in catalogue.suite_names():
        content = asdict(catalogue.find_suite(args.name))
        return answer(args, content, 0, *(f"{key}: {value}" for key, value in content.items()))
    catalogue.check_names([args.name])
    scenario = catalogue.find_scenario(args.name)
    known = card.reference_card(scenario) | {"content hash": scenario.hash}
    lines = [f"# {key}: {' '.join(value.split())}" for key, value in known.items()]
    content = scenario.resolved() | {"hash": scenario.hash}
    return answer(args, content, 0, *lines, "", scenario.to_toml().rstrip())


@command("teach", "lesson", "--estimator", "--seed", "--speed", "--exaggerate", "--port",
         "--no-browser", "--record", "--print-lesson")  # fmt: skip
def demo(args: Args) -> int:
    """Break a live axis in the browser, and watch which estimator detects it first.

    The paper's method (A) runs beside the recommended one (B). Press "motor friction × 2": the upper
    diagram shows how much of the fault each has still to find, and in grey the theoretical limit.
    Stop the clock and step through it; change λ, Δ, μ, noise and dry friction; choose another
    estimator. "What was done" lists every fault as CSV, and as a lesson that repeats it all.

    The page needs no network and is only served on this computer; docs/demo.md says how a class
    sees it. The printed address is the key to it: it holds a secret, new each time.

    example:
      flexaxis demo
      flexaxis demo --estimator rpem-drift --estimator ekf --speed 2
      flexaxis demo flexaxis_lesson.toml
      flexaxis demo flexaxis_lesson.toml --record lesson.gif
    """
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        os.environ.setdefault("MUJOCO_GL", "egl")  # before the engine is imported
    from flexaxis.experiments.demo import lesson as lessons
    from flexaxis.experiments.running.progress import progress

    if args.print_lesson:
        return answer(args, {"lesson": lessons.default_lesson()}, 0, lessons.default_lesson())
    if args.speed is not None and not 0.05 <= args.speed <= 50:
        raise FlexaxisError(f"--speed {args.speed:g}: give a factor from 0.05 to 50")
    check_not_input([args.lesson], args.record)
    if args.record:
        from flexaxis.experiments.demo.movie import record

        with progress(f"recording {args.record}", 1.0) as advance:
            record(
                lessons.load_lesson(args.lesson), args.record, estimators=args.estimator or None,
                seed=args.seed, exaggerate=args.exaggerate, advance=advance,
            )  # fmt: skip
        return answer(args, {"path": args.record}, 0, args.record)
    from flexaxis.experiments.demo.serve import serve
    from flexaxis.experiments.demo.session import DEFAULT_RACERS, DemoSession

    lesson = lessons.load_lesson(args.lesson) if args.lesson else None
    racers = args.estimator or (lesson.estimators if lesson else DEFAULT_RACERS)
    seed = args.seed if args.seed is not None else lesson.seed if lesson else 0

    def warned(line: str) -> None:
        print(f"flexaxis: {line}", file=sys.stderr, flush=True)

    serve(
        DemoSession(estimators=racers, seed=seed), port=args.port, browser=not args.no_browser,
        speed=args.speed or (lesson.speed if lesson else 1.0), exaggerate=args.exaggerate,
        play=lesson and (lambda session: lessons.Player(session, lesson, warned).advance),
        said=lambda line: print(line, flush=True), warned=warned,
    )  # fmt: skip
    return 0


@command("teach", "-o", "--jobs", "--no-cache")
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

    folder = args.output or Path("results/paper")
    store = None if args.no_cache else default_cache()
    with progress("paper", 1) as advance:
        claims = reproduce(folder, command=args.line, jobs=args.jobs, store=store, advance=advance)
    holds = sum(claim.holds for claim in claims)
    lines = [f"{'✓' if each.holds else '✗'} {each.text}" for each in claims]
    content = {"claims": [claim.as_json() for claim in claims], "page": folder / PAGE}
    words = f"{holds} of {len(claims)} claims hold"
    return answer(args, content, int(holds < len(claims)), *lines, words, folder / PAGE)
