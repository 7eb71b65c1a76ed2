"""
A grey-box model as data, with tables of formulas for A, B and C, and nonlinear torque laws.

Each entry of a table is a formula in the physical parameters, such as ``"-(r^2*d_g + f_m)/J_m"``.
The program expands each formula into monomials ``c·Πθ^e``. For any choice of identified parameters,
the program computes the matrices, their derivatives and the tables of the compiled filters from the
monomials.
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
    The model ẋ = A x + B u, y = C x, whose matrix entries are formulas in physical parameters.

    The attribute `laws` adds nonlinear torques to the derivatives of some states. Some torque laws
    have their own state, such as the bristle torque. The states of torque laws come after the
    states of the linear model.

    Parameters
    ----------
    name : str
        Name of the model, which appears in error messages.
    states : sequence of str
        Names of the n states of the linear model.
    A : sequence of n rows of n str
        Entries of A. Each entry of A is a formula with names, numbers, ``+ - * /``, integer powers
        (``^`` or ``**``) and brackets.
    B, C : sequence of n str
        Entries of the column vector B and of the row vector C.
    nominal : mapping
        Nominal value of every physical parameter [SI].
    reset : sequence of str
        Names of the states that are set to zero at the start of every sample, together with their
        sensitivities.
    positive, nonnegative, nonzero : sequence of str
        Names of the parameters whose nominal values must be positive, nonnegative or nonzero,
        respectively.
    identify : sequence of str
        Names of the parameters that are identified by default.
    fixed : sequence of str
        Names of the parameters that cannot change, such as a gear ratio. Change detectors do not
        test fixed parameters for changes.
    laws : sequence of Law
        Nonlinear torque laws, as defined in `flexaxis.estimators.models.laws`.

    Raises
    ------
    EstimatorError
        If the table sizes do not match, or an entry cannot be read. The error is also raised if a
        nominal value is missing, not finite or of the wrong sign.

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
                f"the model {self.name!r} has {n} states, so A needs {n} rows with {n} entries "
                f"each, and B and C need {n} entries each"
            )
        for law in self.laws:
            for state in (*law.acts, *law.drive):
                if state not in self.states and not (state == INPUT and state in law.drive):
                    raise EstimatorError(
                        f"the law {law.kind!r} of the model {self.name!r} contains the unknown "
                        f"state {state!r}: {did_you_mean(state, (*self.states, INPUT))}"
                    )
            if LAWS[law.kind].loaded and "spring" not in {other.kind for other in self.laws}:
                raise EstimatorError(
                    f"the law {law.kind!r} depends on the twist of a law 'spring', but the model "
                    f"{self.name!r} has no law 'spring'; add this law (cubic and gap can be 0)"
                )
        for name in self.parameters:
            if not np.isfinite(self.nominal.get(name, np.nan)):
                raise EstimatorError(
                    f"the model {self.name!r} needs a finite nominal value of {name!r}; nominal "
                    f"values are given for: {', '.join(self.nominal) or 'no parameter'}"
                )
        self._check_signs()
        for row, column, (coefficient, powers) in self.monomials():
            values = np.array([self.nominal[name] for name in powers], float)
            with np.errstate(all="ignore"):
                value = coefficient * np.prod(values ** [*powers.values()])
            if not np.isfinite(value):
                raise EstimatorError(
                    f"the entry in row {row + 1}, column {column + 1} of [A B; C 0] of the model "
                    f"{self.name!r} is not finite at the nominal values of {', '.join(powers)}"
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
                        f"the parameter {name} is {self.nominal[name]:g}, but must be {words} in "
                        f"the model {self.name!r}"
                    )

    @property
    def parameters(self) -> tuple[str, ...]:
        """Physical parameters in matrix entries and torque laws, in the order of ``nominal``."""
        used = {name for *_, (_, powers) in self.monomials() for name in powers}
        used |= self.law_parameters
        return (*(n for n in self.nominal if n in used), *sorted(used.difference(self.nominal)))

    @property
    def law_parameters(self) -> frozenset[str]:
        """Names of all torque law parameters, which are allowed to be zero."""
        return frozenset(name for law in self.laws for name in law.names)

    def monomials(self) -> Iterator[tuple[int, int, Monomial]]:
        """
        Yield row, column and monomial of each term in the block matrix [A B; C 0].

        The first rows and columns of the block matrix belong to the states of the linear model. The
        rows and columns of the torque law states come after those of the linear model and are
        empty. The law torques also count as states, and their rows and columns are the last before
        the output row and the input column. The matrix column of a torque contains the formulas in
        the law's attribute ``acts``.
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
        Select the parameters to identify, and replace all other parameters by their nominal values.

        Parameters
        ----------
        identify : sequence of str, optional
            Names of physical parameters, such as ``"J_a"``, or of inverse parameters, such as
            ``"1/J_a"``. By default, the model's attribute ``identify`` is used.

        Returns
        -------
        Parametrization
            The model as a function of the identified parameters θ.

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
                    f"the model {self.name!r} has no parameter {asked!r} to identify: "
                    + did_you_mean(name, self.parameters)
                    + "; inverse parameters such as '1/J_a' are also allowed"
                )
            if name != asked and name in of_laws:
                raise EstimatorError(
                    f"{asked!r} cannot be identified, because a torque law depends on {name!r}; "
                    f"identify {name!r} instead"
                )
            if physical.count(name) > 1:
                raise EstimatorError(
                    f"the option identify contains {name!r} twice: {', '.join(identify)}"
                )
        if not physical:
            raise EstimatorError("the option identify is empty; give at least one parameter")
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
