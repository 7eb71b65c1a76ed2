"""
A grey-box model as data: tables of formulas for A, B and C, and nonlinear laws.

Every entry of a table is a formula in the physical parameters, such as ``"-(r^2*d_g + f_m)/J_m"``.
Each formula is multiplied out into monomials ``c·Πθ^e``. The matrices at any θ, their derivatives
and the tables of the compiled filters are computed from these monomials, for any choice of
identified parameters.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.formula import Monomial, multiply_out
from flexaxis.estimators.models.laws import INPUT, LAWS, Law
from flexaxis.estimators.models.parametrization import Parametrization, law_records


@dataclass(frozen=True)
class Model:
    """
    The model ẋ = A x + B u, y = C x, with entries that are formulas in physical parameters.

    The `laws` add their torques to the derivatives of some states. Some laws have a state of their
    own, such as the torque of bristles; these states follow the states of the linear model.

    Parameters
    ----------
    name : str
        Name of the model, used in messages.
    states : sequence of str
        Names of the n states.
    A : sequence of n rows of n str
        Entries of A: formulas with names, numbers, ``+ - * /``, integer powers (``^`` or ``**``)
        and brackets.
    B, C : sequence of n str
        Entries of the column B and of the row C.
    nominal : mapping
        Nominal value of every physical parameter [SI].
    reset : sequence of str
        States that are set to zero, with their sensitivities, at the start of every sample.
    positive, nonnegative, nonzero : sequence of str
        Names of the parameters whose nominal value must be positive, must not be negative, or must
        not be zero.
    identify : sequence of str
        Parameters that are identified by default.
    fixed : sequence of str
        Parameters that cannot change, such as a gear ratio; detectors do not test them for changes.
    laws : sequence of Law
        Nonlinear laws; see `flexaxis.estimators.models.laws`.

    Raises
    ------
    EstimatorError
        If the tables do not fit together, an entry cannot be read, or a nominal value is missing,
        not finite or of the wrong sign.

    Examples
    --------
    >>> lag = Model("lag", states=("v",), A=[["-f/J"]], B=["k/J"], C=["1"],
    ...             nominal={"f": 2.0, "J": 1.0, "k": 3.0})
    >>> lag.parametrize(["f"]).matrices([2.0])[0]
    array([[-2.]])
    """

    name: str
    states: Sequence[str]
    A: Sequence[Sequence[str]]
    B: Sequence[str]
    C: Sequence[str]
    nominal: Mapping[str, float]
    reset: Sequence[str] = ()
    positive: Sequence[str] = ()
    nonnegative: Sequence[str] = ()
    nonzero: Sequence[str] = ()
    identify: Sequence[str] = ()
    fixed: Sequence[str] = ()
    laws: Sequence[Law] = ()

    def __post_init__(self) -> None:
        n = len(self.states)
        if [len(self.A), len(self.B), len(self.C), *map(len, self.A)] != [n] * (n + 3):
            raise EstimatorError(
                f"model {self.name!r} has {n} states, so A needs {n} rows of {n} entries, "
                f"and B and C need {n} entries each"
            )
        for law in self.laws:
            for state in (*law.acts, *law.drive):
                if state not in self.states and not (state == INPUT and state in law.drive):
                    raise EstimatorError(
                        f"law {law.kind!r} of model {self.name!r} names an unknown state "
                        f"{state!r}: {did_you_mean(state, (*self.states, INPUT))}"
                    )
            if LAWS[law.kind].loaded and "spring" not in {other.kind for other in self.laws}:
                raise EstimatorError(
                    f"law {law.kind!r} depends on the drive of a law 'spring', and model "
                    f"{self.name!r} has no such law; add one (cubic and gap may be 0)"
                )
        for name in self.parameters:
            if not np.isfinite(self.nominal.get(name, np.nan)):
                raise EstimatorError(
                    f"model {self.name!r} needs a finite nominal value of {name!r}; "
                    f"given: {', '.join(self.nominal) or 'none'}"
                )
        self._check_signs()
        for row, column, (coefficient, powers) in self.monomials():
            values = np.array([self.nominal[name] for name in powers], float)
            with np.errstate(all="ignore"):
                value = coefficient * np.prod(values ** [*powers.values()])
            if not np.isfinite(value):
                raise EstimatorError(
                    f"row {row + 1}, column {column + 1} of [A B; C 0] of model {self.name!r} is "
                    f"not finite at the nominal values of {', '.join(powers)}"
                )

    def _check_signs(self) -> None:
        own = [(law.roles[role], name) for law in self.laws for role, name in law.own.items()]
        positive = [name for role, name in own if role.needed]
        nonnegative = [name for role, name in own if not role.signed]
        for names, allowed, words in (
            ([*self.positive, *positive], np.greater, "above 0"),
            ([*self.nonnegative, *nonnegative], np.greater_equal, "at least 0"),
            (self.nonzero, np.not_equal, "other than 0"),
        ):
            for name in names:
                if name in self.nominal and not allowed(self.nominal[name], 0):
                    raise EstimatorError(
                        f"{name} = {self.nominal[name]:g} is not possible in model {self.name!r}: "
                        f"its value must be {words}"
                    )

    @property
    def parameters(self) -> tuple[str, ...]:
        """Physical parameters used in entries and laws, in the order of ``nominal``."""
        used = {name for *_, (_, powers) in self.monomials() for name in powers}
        used |= self.law_parameters
        return (*(n for n in self.nominal if n in used), *sorted(used.difference(self.nominal)))

    @property
    def law_parameters(self) -> frozenset[str]:
        """Names of the parameters of all laws; these parameters may be zero."""
        return frozenset(name for law in self.laws for name in law.names)

    def monomials(self) -> Iterator[tuple[int, int, Monomial]]:
        """
        Yield row, column and monomial of every term of the block matrix [A B; C 0].

        The states of the linear model are followed by the states of the laws, which have no terms,
        and by the torque of each law. The column of a torque contains the formulas in ``acts``.
        """
        more = ["0"] * (sum(LAWS[law.kind].remembers for law in self.laws) + len(self.laws))
        rows = [[*row, *more, b] for row, b in zip(self.A, self.B, strict=True)]
        for i, law in enumerate(self.laws):
            for state, formula in law.acts.items():
                rows[list(self.states).index(state)][-1 - len(self.laws) + i] = formula
        rows += [[]] * len(more) + [[*self.C, *more, "0"]]
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                for monomial in multiply_out(entry):
                    yield i, j, monomial

    def parametrize(self, identify: Sequence[str] | None = None) -> "Parametrization":
        """
        Select the parameters to identify; nominal values replace all other parameters.

        Parameters
        ----------
        identify : sequence of str, optional
            Names of physical parameters, such as ``"J_a"``, or their inverses, such as ``"1/J_a"``;
            the model's attribute ``identify`` by default.

        Returns
        -------
        Parametrization
            The model as a function of θ.

        Raises
        ------
        EstimatorError
            If a name is unknown, a parameter is listed twice, or no parameter is listed.
        """
        identify = self.identify if identify is None else identify
        of_laws = {name for law in self.laws for name in law.parameters.values()}
        physical = [name.removeprefix("1/") for name in identify]
        for name, asked in zip(physical, identify, strict=True):
            if name not in self.parameters:
                raise EstimatorError(
                    f"model {self.name!r} has no parameter {asked!r} to identify: "
                    + did_you_mean(name, self.parameters)
                    + "; or an inverse, such as '1/J_a'"
                )
            if name != asked and name in of_laws:
                raise EstimatorError(
                    f"{asked!r} cannot be identified: a law depends on {name}; identify {name!r}"
                )
            if physical.count(name) > 1:
                raise EstimatorError(
                    f"identify names {name!r} twice in {', '.join(identify)}; name it once"
                )
        if not physical:
            raise EstimatorError("identify is empty; name at least one parameter")
        sign = np.array([-1 if name.startswith("1/") else 1 for name in identify])
        terms = []
        for row, column, (coefficient, powers) in self.monomials():
            fixed = [self.nominal[k] ** float(e) for k, e in powers.items() if k not in physical]
            exponent = [powers.get(name, 0) for name in physical]
            terms.append((row, column, coefficient * float(np.prod(fixed)), exponent))
        rows, columns, coefficients, exponents = map(np.array, zip(*terms, strict=True))
        laws, drive = law_records(self.laws, self.states, self.nominal, identify)
        return Parametrization(
            names=tuple(identify),
            theta=np.array([self.nominal[k] for k in physical], float) ** sign,
            n=drive.shape[1] - 1 + len(laws),
            row=rows,
            column=columns,
            coefficient=coefficients,
            exponent=exponents * sign,
            reset=tuple(list(self.states).index(state) for state in self.reset),
            laws=laws,
            drive=drive,
            additive=tuple(name in self.law_parameters for name in identify),
        )
