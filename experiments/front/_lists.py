"""What there is: the scenarios of the catalogue, and the registered estimators."""

from __future__ import annotations

from flexaxis._table import Names


def scenarios(*, group: str = "", find: str = "") -> Names:
    """Return the names of the catalogue's scenarios; they show themselves as a table.

    Parameters
    ----------
    group : str, optional
        Only those of a group, such as ``"steps"``.
    find : str, optional
        Only those with this text in their name or in what is said of them.

    Returns
    -------
    Names

    Raises
    ------
    FlexaxisError
        If there is no such group.

    Examples
    --------
    >>> import flexaxis as fx
    >>> tuple(fx.scenarios(group="nominal"))
    ('n2_nominal-v1', 'paper_nominal-v1')
    """
    from flexaxis.experiments.catalogue.listing import scenario_lines

    return Names.of(scenario_lines(group=group, find=find), ("name", "difficulty", "content"))


def estimators(*, find: str = "") -> Names:
    """Return the names of the registered estimators; they show themselves as a table.

    Parameters
    ----------
    find : str, optional
        Only those with this text in their name or summary.
    """
    from flexaxis.experiments.catalogue.listing import lines

    return Names.of(lines("estimators", find=find), ("name", "summary"))
