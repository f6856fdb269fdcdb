"""The result of a relaxation: weights with the proof of a bound, and its certificate."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from criteria import Relaxable
from edtk.design.bound import BLURRED, VISIBLE, Bound, BoundKind, RelaxedDesign, printed_form
from edtk.design.formula import free_name
from edtk.design.problem import Problem, problem_digest
from edtk.design.relaxation.certify import certify, inside
from edtk.design.relaxation.proof import InnerProof, normalised
from edtk.design.relaxation.setting import OrderOne, Setting, opened
from edtk.design.relaxation.weight_limits import WeightLimits
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.theta_box import WorstTheta

CERTIFICATE = "relaxation of a problem"  # the kind of the certificates that are made here
SOLVER = "from a certificate"


@dataclass(frozen=True, eq=False, kw_only=True)
class Relaxation(RelaxedDesign):
    """A relaxed design over the candidates of a problem, each with its weight (n,).

    Attributes:
        problem: The candidates; None where they are not kept.
        accuracy: Relative error that rounding may have made in cost and bound, see
            `proof.errors`.
        rests_on_solver: Whether the bound rests on a solver's word, as of a criterion without a
            dual form of its own; else closed forms prove it.
        inner: The multipliers with more digits, of a model whose parameters are nearly dependent.
        worst: Where in ranges of theta it is worst; None of a problem without any.
    """

    criterion: Relaxable
    problem: Problem | None = None
    accuracy: float = float("nan")
    rests_on_solver: bool = False
    inner: InnerProof | None = None
    worst: "WorstTheta | None" = None

    def headline(self) -> str:
        """Criterion, value, number of candidates with weight, gap, and what doubts there are."""
        proved = "gap by a solver's word" if self.rests_on_solver else "proved gap"
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {self.value:.4g}, weights on {len(self.support)} of "
            f"{len(self.weights)} candidates, {proved} {self.gap:.1e}{digits}"
            f"{'' if self.worst is None else f', {self.worst}'}"
        )

    @property
    def support(self) -> Indices:
        """Indices (k,) of the candidates that carry weight."""
        return np.flatnonzero(self.weights != 0)

    @property
    def places(self) -> Indices:
        """The candidates of the support."""
        return self.support

    def to_frame(self) -> "pd.DataFrame":
        """The candidates that carry weight, in the order of the problem, with their weights.

        Candidates from a data frame are its rows; others are numbers from zero.
        """
        import pandas as pd

        if self.problem is not None:
            return self.problem.to_frame(self.weights)
        index = pd.Index(self.support, name="candidate")
        return pd.DataFrame({"weight": self.weights[self.support]}, index=index)

    def to_dict(self) -> dict[str, Any]:
        """The certificate as plain data for JSON, which `edtk.verify` checks with the problem.

        Raises:
            ValueError: The relaxation does not hold its candidates.
        """
        if self.problem is None:
            raise ValueError("this relaxation does not hold its candidates; edtk.relax keeps them")
        # The two triangles of a product differ by rounding; a certificate has one matrix.
        symmetric = 0.5 * (self.multipliers + np.swapaxes(self.multipliers, 1, 2))
        return replace(self, multipliers=symmetric)._content(self.problem)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], problem: Problem) -> "Relaxation":
        """Restore what `to_dict` has written; cost and bound are computed anew.

        Args:
            data: The certificate.
            problem: Its candidates.

        Raises:
            ValueError: The candidates are others, weights or multipliers do not fit them, or the
                data are not those of a certificate.
        """
        try:
            return _restored(data, problem)
        except ValueError:
            raise
        # Whatever an enemy, or a disk, has put in the place of numbers, tables and names.
        except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            words = " ".join(f"{type(error).__name__}: {error}".split())
            raise ValueError(f"this is no certificate of a relaxation ({words})") from error

    def sensitivities(self, problem: Problem) -> Array:
        """Sensitivities (r, n) of candidates to the multipliers, with all digits.

        By the equivalence theorem the candidates of an optimal design have the largest one. Of
        degree zero they are per trace.

        Args:
            problem: The candidates (n).
        """
        if self.inner is None:
            return normalised(problem, self.criterion).sensitivities(self.multipliers)
        inside = self.criterion.transformed(self.inner.T)
        assert inside is not None
        return normalised(problem.in_units(self.inner.T), inside).sensitivities(self.inner.Z)

    def certify(self, problem: Problem) -> tuple[float, float]:
        """Compute cost and bound anew from weights, multipliers and candidates alone.

        Args:
            problem: The candidates (n) of the weights.

        Returns:
            Cost of the weights, and a lower bound on the cost of all weights; zero where the
            multipliers prove none.

        Raises:
            ValueError: Weights or multipliers do not fit the problem, or are no such numbers.
        """
        return certify(problem, self.criterion, self.weights, self.multipliers, self.inner)

    def _content(self, problem: Problem) -> dict[str, Any]:
        """The certificate; value and bound are those that `certify` finds from the rest."""
        cost, bound = self.certify(problem)
        sense = self.criterion.sense
        content = {
            "kind": CERTIFICATE,
            "criterion": self.criterion.to_dict(),
            "candidates": {
                "number": problem.n,
                "parameters": list(problem.parameters),
                "sha256": problem_digest(problem),
            },
            "weights": {
                "candidate": self.support.tolist(),
                "weight": self.weights[self.support].tolist(),
            },
            "value": printed_form(cost, sense),
            # JSON knows no infinity, as which a maximised criterion prints a bound that says
            # nothing.
            "bound": printed_form(bound, sense) if bound else None,
            "gap": 1 - bound / cost,
            "multipliers": self.multipliers.tolist(),
        }
        duals = _dual_weights(self.weights, *self._inside(problem))
        if any(u is not None for u in duals):
            content["dual_weights"] = [u.tolist() for u in duals if u is not None]
        if self.inner is not None:
            content["inner"] = {"T": self.inner.T.tolist(), "Z": self.inner.Z.tolist()}
        return content

    def _inside(self, problem: Problem) -> tuple[Problem, Relaxable, Array]:
        """Problem, criterion and multipliers with all their digits."""
        return inside(problem, self.criterion, self.multipliers, self.inner)

    def in_given_unit(self, sized: OrderOne) -> "Relaxation":
        """The result for the candidates as given, of one for those of order one."""
        if not sized.power:
            return self
        bound = self.proved_bound
        return replace(
            self,
            cost=sized.cost(self.cost, self.criterion),
            proved_bound=replace(bound, cost=sized.cost(bound.cost, self.criterion)),
        )

    def opened(self, problem: Problem) -> "Relaxation":
        """The result of a closed problem as one of the problem itself.

        With the projection ``P = I - U W'`` the multiplier ``P Z P'`` has the same sensitivities to
        the candidates and the same ``K'Z K`` as Z, and none to W W'.

        Args:
            problem: The problem as it was given; this is of its `without_open_directions`.
        """
        Z = opened(problem, self.multipliers)
        largest = problem.sensitivities(Z).max(axis=-1)
        cost = self.criterion.lower_bound(Z, largest, problem.information(self.weights))
        bound = Bound.of(self.criterion, cost, self.cost, BoundKind.PROVED_ON_CANDIDATES)
        return replace(self, multipliers=Z, proved_bound=bound)

    def outward(self, setting: Setting) -> "Relaxation":
        """The result as one of the problem as it was given, with its accuracy."""
        of_cost, of_bound = setting.errors(self.weights, self.multipliers)
        M = setting.problem.information(self.weights)
        believes = setting.criterion.rests_on_solver(self.multipliers, M)
        bound = Bound.of(
            setting.given,
            self.proved_bound.cost,
            self.cost,
            BoundKind.SOLVED if believes else self.proved_bound.kind,
            of_bound,
            max(of_cost, BLURRED),
        )
        found = replace(
            self,
            accuracy=of_cost + of_bound,
            rests_on_solver=believes,
            proved_bound=bound,
        )
        if setting.whitened is None:
            return found
        inner = InnerProof(setting.whitened.T, found.multipliers)
        return replace(found, criterion=setting.given, multipliers=inner.outward(), inner=inner)


@dataclass(frozen=True, eq=False, kw_only=True)
class RelaxationWithin(Relaxation):
    """A relaxed design whose counts ``experiments * weights`` obey limits.

    Value and bound are those of one experiment, or of all of them where no size is given.

    Attributes:
        limits: The limits.
        experiments: Number of experiments, not whole where budgets decide it.
    """

    limits: WeightLimits
    experiments: float

    @classmethod
    def of(cls, found: Relaxation, limits: WeightLimits, experiments: float) -> "RelaxationWithin":
        """A relaxation whose counts obey limits."""
        parts: dict[str, Any] = {field.name: getattr(found, field.name) for field in fields(found)}
        return cls(**parts, limits=limits, experiments=experiments)

    @property
    def counts(self) -> Array:
        """Counts (n,) of the candidates, not whole."""
        return self.experiments * self.weights

    def headline(self) -> str:
        """That of a relaxation, and that it is within limits."""
        free = self.limits.size is None
        number = f", {self.experiments:.4g} experiments" if free else ""
        return f"{super().headline()}, within the limits{number}"

    def certify(self, problem: Problem) -> tuple[float, float]:
        """Cost and bound computed anew within the limits, see `Relaxation.certify`."""
        beside = (self.inner, self.limits, self.experiments)
        return certify(problem, self.criterion, self.weights, self.multipliers, *beside)

    def _content(self, problem: Problem) -> dict[str, Any]:
        """That of a relaxation, with the limits and the multipliers of theirs."""
        plain, _, multipliers = self._inside(problem)
        return {
            **super()._content(problem),
            "limits": self.limits.to_dict(),
            "experiments": self.experiments,
            "limit_multipliers": _of_limits(self.limits, plain, multipliers),
        }

    def to_frame(self) -> "pd.DataFrame":
        """The candidates that carry weight, with their weights and counts."""
        frame = super().to_frame()
        name = free_name("count", frame)
        return frame.assign(**{name: self.counts[self.support]})


def _dual_weights(
    weights: Array, problem: Problem, criterion: Relaxable, multipliers: Array
) -> list[Array | None]:
    """The shares that go with each of the multipliers (r, p, p), see `Relaxable.dual_weights`."""
    M = problem.information(weights)
    try:
        return [criterion.dual_weights(Z, M) for Z in multipliers]
    except np.linalg.LinAlgError:
        # The design is all but singular: the check finds its own, or none.
        return []


def _of_limits(limits: WeightLimits, problem: Problem, multipliers: Array) -> list[list[float]]:
    """Multipliers (r, k) of the limits' constraints, where the largest sensitivity is one."""
    each = problem.sensitivities(multipliers)
    return [limits.largest(gains / (gains.max() or 1.0))[1].tolist() for gains in each]


def _restored(data: Mapping[str, Any], problem: Problem) -> Relaxation:
    """The relaxation of a certificate, of which nothing is believed."""
    if data["candidates"]["sha256"] != problem_digest(problem):
        raise ValueError("the certificate is about other candidates than those of this problem")
    criterion = criteria.from_dict(data["criterion"])
    if not isinstance(criterion, criteria.Relaxable):
        raise ValueError(f"criterion {criterion.name!r} cannot be relaxed")
    weights = _read_weights(data["weights"], problem.n)
    multipliers = np.array(data["multipliers"], dtype=float)
    kept = data.get("inner")
    inner = None if kept is None else InnerProof(np.array(kept["T"]), np.array(kept["Z"]))
    limits = None if "limits" not in data else WeightLimits.from_dict(data["limits"])
    experiments = 1.0 if limits is None else float(data["experiments"])
    cost, bound = certify(problem, criterion, weights, multipliers, inner, limits, experiments)
    believes = np.isfinite(cost) and criterion.rests_on_solver(
        multipliers, problem.information(weights)
    )
    kind = BoundKind.SOLVED if believes else BoundKind.PROVED_ON_CANDIDATES
    found = Relaxation(
        criterion=criterion,
        weights=weights,
        cost=cost,
        proved_bound=Bound.of(criterion, bound, cost, kind),
        multipliers=multipliers,
        solver=SOLVER,
        iterations=0,
        rests_on_solver=bool(believes),
        inner=inner,
        problem=problem,
    )
    return found if limits is None else RelaxationWithin.of(found, limits, experiments)


def _read_weights(data: Mapping[str, Any], n: int) -> Array:
    """Weights (n,) of the candidates that are listed with theirs.

    Raises:
        ValueError: The lists are not of the same length, or name a candidate that is none or twice.
    """
    chosen = data["candidate"]
    listed = np.array(data["weight"], dtype=float)
    are_indices = all(type(i) is int and 0 <= i < n for i in chosen)
    if not are_indices or len(set(chosen)) < len(chosen) or listed.shape != (len(chosen),):
        raise ValueError(
            f"weights: expected a weight for each of some candidates, from 0 to {n - 1}, once each"
        )
    weights = np.zeros(n)
    weights[np.array(chosen, dtype=int)] = listed
    return weights
