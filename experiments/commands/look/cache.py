"""Look at the cache of simulated records, or empty it.

A record is kept under its content (scenario, seed, engine, our simulation code), so an entry is
never stale; the least recently used go when the limit is met. FLEXAXIS_CACHE sets the folder,
FLEXAXIS_CACHE_LIMIT the limit in MB.

example:
  flexaxis cache info
  flexaxis cache clear
"""

from __future__ import annotations

import argparse

from flexaxis.experiments.commands.answers import answer

HELP = "show or empty the cache of simulated records"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("action", choices=("info", "clear"))


def main(args: argparse.Namespace) -> int:
    """Show or empty it."""
    from flexaxis.experiments.running.cache import default_cache

    store = default_cache()
    facts: dict[str, object] = {"folder": str(store.folder), "limit_mb": store.limit / 1024**2}
    if args.action == "clear":
        facts["removed"] = store.clear()
    facts |= {"records": len(store.entries()), "size_mb": round(store.size() / 1024**2, 1)}
    return answer(args, facts, 0, *(f"{key}: {value}" for key, value in facts.items()))
