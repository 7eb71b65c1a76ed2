"""What is typed: a parser that suggests, names checked before any work.

The metavar of an argument says what its words are; `CHECKS` has those that can be looked up.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from flexaxis.experiments.catalogue.names import scenario_names, suite_names
from flexaxis.experiments.commands.answers import WRONG_USE, refusal, too_large
from flexaxis.experiments.seeds import parse_seeds
from flexaxis.sim.errors import FlexaxisError, ScenarioError, did_you_mean

_CHOICE = re.compile(r"invalid choice: '?([^' ]*)'? \(choose from (.*)\)")


class Parser(argparse.ArgumentParser):
    """An argument parser that names the nearest right word for a wrong one.

    A beginning of an option is not taken for it: the next version may have another with it.
    """

    def __init__(self, *args: Any, **more: Any) -> None:
        super().__init__(*args, **({"allow_abbrev": False} | more))
        self._typed: Sequence[str] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return what was typed, and what no option goes by."""
        self._typed = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def _unknown_options(self) -> list[str]:
        """Return the options typed that this parser has not; a command's own are its parser's."""
        if any(isinstance(action, argparse._SubParsersAction) for action in self._actions):
            return []
        options = [word for word in self._typed if re.match(r"--[a-z]", word)]
        known = self._option_string_actions
        return [word for word in options if word.partition("=")[0] not in known]

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return what was typed; what no option goes by is refused with the nearest one."""
        found, more = self.parse_known_args(args, namespace)
        if more:
            sub = getattr(found, "parser", self)
            sub.error(" ".join(sub.refused(word) for word in more))
        return found

    def refused(self, word: str) -> str:
        """Return what to say of a word that nothing takes."""
        if not word.startswith("-"):
            return f"{word!r} is one word too many."
        option = word.partition("=")[0]
        known = [name for action in self._actions for name in action.option_strings]
        return f"unknown option {word!r}.{did_you_mean(option, known)}"

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and how it may have been meant."""
        found = _CHOICE.search(message)
        wrong = self._unknown_options()
        if wrong and (found or "required" in message):  # its value was taken for another word
            message = " ".join(self.refused(word) for word in wrong)
        elif found:
            known = re.findall(r"[\w.-]+", found[2])
            hint = did_you_mean(found[1], known)
            message = message[: found.start()] + f"unknown {found[1]!r}.{hint}"
            message += "" if hint else f" It is one of: {', '.join(known)}"
        if "--json" in self._typed:
            _, _, command = self.prog.partition(" ")
            words = [*([command] if command else []), *self._typed]
            print(refusal(command or None, words, WRONG_USE, message))
        super().error(message)


def check_words(parser: argparse.ArgumentParser, args: argparse.Namespace) -> None:
    """Look up the names, files and numbers that were typed; no code of a user is run.

    Raises
    ------
    FlexaxisError
        With a line for each that is wrong.
    """
    from flexaxis.estimators.errors import EstimatorError
    from flexaxis.experiments.commands import options

    problems = [*too_large(parser, args)]
    if "jobs" in args:
        options.check_jobs(args)
    if "shard" in args:
        options.shard(args)
    if getattr(args, "dask", None):
        options.check_dask(args)
    limit = getattr(args, "time_limit", None)
    if limit is not None and not 0 < limit < float("inf"):
        problems.append(f"--time-limit {limit}: give a finite number above 0")
    for check, word in _looked_up(parser, args):
        try:
            check(word)
        except (EstimatorError, FlexaxisError) as error:
            problems.append(str(error))
    if problems:
        raise FlexaxisError("\n".join(dict.fromkeys(problems)))


def _looked_up(
    parser: argparse.ArgumentParser, args: argparse.Namespace
) -> Iterator[tuple[Callable[[str], object], str]]:
    """Yield each word that can be looked up, with what does it."""
    for action in parser._actions:
        check = CHECKS.get(str(action.metavar))
        given = getattr(args, action.dest, None)
        if check is None or given is None or action.dest == "output":
            continue
        for word in [given] if isinstance(given, str | Path) else given:
            yield check, str(word)


def _scenario(text: str, *, suites: bool = False) -> None:
    from flexaxis.experiments.catalogue import names

    if text.endswith(".toml"):
        from flexaxis.experiments.catalogue.find import find_scenario

        find_scenario(text)
    known = names.is_scenario(text) or (suites and text in names.suite_names())
    if not (known or text.endswith((".nc", ".toml")) or Path(text).exists()):
        raise names.unknown_scenario(text)


def _of_suites(text: str) -> None:
    _scenario(text, suites=True)


def _estimator(text: str) -> None:
    from flexaxis.experiments.running.estimators import parse

    parse(text)


def _file(text: str) -> None:

    path = Path(text)
    if not path.exists():
        near = [f.name for f in path.parent.glob(f"*{path.suffix}")]
        raise FlexaxisError(f"{path} cannot be read: no such file.{did_you_mean(path.name, near)}")
    if not (path.is_file() or path.is_dir()):  # a pipe can be read once, and may never end
        raise FlexaxisError(f"{path} is no file but a pipe or a device: save it to a file first")


def _record(text: str) -> None:
    if text.endswith(".nc"):
        _file(text)
    else:
        _scenario(text)


def _study(text: str) -> None:

    from flexaxis.experiments.running.store import Store

    Store.read(Path(text)).close()


def _anything(text: str) -> None:
    try:
        _of_suites(text)
    except ScenarioError:
        if text in _estimators():
            return
        hint = did_you_mean(text, [*_scenarios(), *_estimators()])
        if not hint or text.endswith(".toml"):
            raise
        raise FlexaxisError(
            f"unknown scenario, suite or estimator {text!r}.{hint} `flexaxis list` shows them; a "
            "path to a TOML file works too"
        ) from None


def _seeds(text: str) -> None:

    parse_seeds(text)


CHECKS: Mapping[str, Callable[[str], object]] = {
    "E": _estimator,
    "ESTIMATOR": _estimator,
    "SCENARIO": _scenario,
    "SUITE|SCENARIO": _of_suites,
    "SCENARIO|SUITE|ESTIMATOR": _anything,
    "SUITE|SCENARIO|RUN": _of_suites,
    "SCENARIO|RECORD.nc": _record,
    "RECORD.nc": _file,
    "LOG": _file,
    "LOG|REC.nc": _file,
    "FILE.toml": _file,
    "AXIS.toml": _file,
    "DIR": _study,
    "N or A:B": _seeds,
}
"""How a word is looked up, by the metavar of its argument."""


def _scenarios() -> list[str]:

    return [*suite_names(), *scenario_names()]


def _estimators() -> list[str]:
    from flexaxis.estimators.registry import REGISTRY

    return list(REGISTRY)
