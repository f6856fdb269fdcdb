"""A certificate read back, and all numbers that follow from it: of weights, of a plan, and of all
plans of whole experiments on its candidates.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.day_bound import DayBound, read_proofs
from edtk.certificate.proof import LARGEST, Experiments, LargestSensitivities, Proof
from edtk.certificate.recompute import values
from edtk.certificate.recompute.array_criteria import FORMS, Part
from edtk.certificate.recompute.arrays import Candidates
from edtk.certificate.recompute.candidates import candidates, of_rows, require
from edtk.certificate.recompute.covering import largest_sensitivities
from edtk.certificate.recompute.day import Day
from edtk.certificate.recompute.eigenpairs import LONG
from edtk.certificate.recompute.exact_tree import Tree, plan_of
from edtk.certificate.recompute.plain_data import number, table, text, whole
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.values import Multipliers, lower_bound
from edtk.system.typing import Array, Indices

KEYS = ("criterion", "kind", "claims", "experiments", "kept", "proof", "setting")
ON_CANDIDATES = "on_candidates"
DECORATION = ("edtk", "title", "study_sha256")  # keys on which no claim rests
AMOUNTS = {"relaxation": "weight", "plan": "repeats"}
LONGEST_LABEL = 60
MOST_REPEATS = 1e9
MOST_NUMBERS = 2e7  # in the rows of all experiments, or the information of all candidates
WEIGHTS_SUM = 1e-9  # deviation from one that is rounding
KEYS_ON_CANDIDATES = ("candidates", "plan", "value", "bound_exact", "proved_exact", "tree")


@dataclass(frozen=True, eq=False)
class ExactOnCandidates:
    """A proof about all plans on the first candidates of a sequence, which are drawn anew.

    Attributes:
        number: Number of candidates.
        counts: The plan that is said to be the best known (n,): how often each is measured.
        tree: Why.
        stated: What is claimed: `value`, `bound_exact` and `proved_exact`.
        setting: Robot, load, noise and limits.
        proof: Seed of the sequence.
    """

    number: int
    counts: Indices
    tree: Tree
    stated: dict[str, Any]
    setting: Setting
    proof: Proof

    @classmethod
    def from_dict(cls, content: Any, setting: Setting, proof: Proof) -> "ExactOnCandidates":
        """Read the part `on_candidates` of a certificate.

        Raises:
            ValueError: A part is missing, is not what it should be, or is too much to check.
        """
        content = table(content, KEYS_ON_CANDIDATES, ON_CANDIDATES)
        n = whole(content["candidates"], 1, LARGEST, f"{ON_CANDIDATES}.candidates")
        if n * setting.p * max(setting.p + 1, 2 * len(setting.sigma)) > 2 * MOST_NUMBERS:
            raise ValueError(f"{ON_CANDIDATES}: {n} candidates are more than are computed here")
        if not isinstance(content["proved_exact"], bool):
            raise ValueError(f"{ON_CANDIDATES}.proved_exact: expected true or false")
        table(content["plan"], ("candidate", "count"), f"{ON_CANDIDATES}.plan")
        names = ("value", "bound_exact")
        tree = Tree.of(content["tree"], n, setting.p)
        weights = setting.tasks.weights
        if tree.shares is not None and tree.shares.shape[1] == len(weights):
            # A task that the design does not weigh is no part of the worst.
            tree = replace(tree, shares=tree.shares[:, weights > 0])
        return cls(
            number=n,
            counts=plan_of(content["plan"], n),
            tree=tree,
            stated={name: number(content[name], f"{ON_CANDIDATES}.{name}") for name in names}
            | {"proved_exact": content["proved_exact"]},
            setting=setting,
            proof=proof,
        )

    @cached_property
    def drawn(self) -> Experiments:
        """The candidates, each with its repetitions in the plan.

        Raises:
            ValueError: They cannot be drawn.
        """
        n = len(self.setting.fixed)
        chunks = candidates(self.setting, self.proof.seed, self.proof.sampling, self.number)
        x = np.concatenate(list(chunks))
        return Experiments(x[:, :n], self.setting.load.wrench(x[:, n:]), self.counts.astype(float))

    @property
    def plan(self) -> Experiments:
        """The experiments of the plan."""
        return self.drawn.chosen(self.counts > 0)

    def beside(self, known: Array) -> Candidates:
        """What one visit of each candidate tells, with the information (p, p) of every plan.

        Visits that share errors tell less together, so that bounds hold for them as well.
        """
        return Candidates(self.drawn.rows(self.setting), None, known.astype(LONG), "")

    def part(self, name: str) -> Part:
        """The criterion, of a name, in the form in which whole plans are bounded.

        Raises:
            ValueError: There is none.
        """
        if name not in FORMS:
            raise ValueError(f"the criterion {name} has no second implementation for whole plans")
        p = self.setting.p
        if name not in values.OF_TARGET:
            K = self.setting.interest
            given = {"name": name} if K is None else {"name": name, "interest": K.tolist()}
            return Part.of(given, p)
        targets = self.setting.tasks.targets(name)
        if not targets:
            raise ValueError(f"{name} needs a test pose")
        form, power = FORMS[name]
        lengths = [len(target) for target in targets]
        number = np.arange(len(targets)) if form == "worst" else np.zeros(len(targets))
        groups = np.repeat(number.astype(float), lengths).astype(int)
        return Part(form, power, np.concatenate(targets).T, 1.0, groups, needs_all=True)


@dataclass(frozen=True, eq=False)
class Case:
    """All parts of a certificate, with the numbers that follow from them.

    Attributes:
        name: Name of the criterion.
        kind: "relaxation" or "plan".
        setting: Robot, load, noise, constraints and test pose.
        made: The experiments with their weights or repetitions.
        kept: Experiments that were made before; there may be none.
        proof: Candidates, multipliers, and poses of the relaxation and of the search.
        stated: The claims by name, as they are written.
        sharing: Number of experiments that share what is known beforehand, for a relaxation.
        day: What visits and load changes cost, and the budget of a plan; None without one.
        proofs: The proofs of sets of loads within a budget, of which `proof` is the first.
        on_candidates: What is said of all plans of whole experiments on candidates; None for none.
    """

    name: str
    kind: str
    setting: Setting
    made: Experiments
    kept: Experiments
    proof: Proof
    stated: dict[str, Any]
    sharing: int = 1
    day: Day | None = None
    proofs: dict[tuple[int, ...], Proof] = field(default_factory=dict)
    on_candidates: ExactOnCandidates | None = None

    @classmethod
    def from_dict(cls, content: Any) -> "Case":
        """Read a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(
            content, KEYS, "certificate", (*DECORATION, "sharing", "day", ON_CANDIDATES)
        )
        name = _criterion_name(content["criterion"])
        kind = text(content["kind"], AMOUNTS, "kind")
        setting = Setting.from_dict(content["setting"])
        n = len(setting.fixed)
        made = Experiments.from_list(content["experiments"], AMOUNTS[kind], n, "experiments")
        kept = Experiments.from_list(content["kept"], "repeats", n, "kept")
        if not len(made):
            raise ValueError("experiments: expected at least one")
        if kind == "relaxation" and len(kept):
            raise ValueError("kept: expected none beside the weights of a relaxation")
        some = len(made) + len(kept)
        if some * len(setting.sigma) * setting.p > MOST_NUMBERS:
            raise ValueError(f"experiments: {some} have more rows than are computed here")
        require(of_rows(setting, some), f"{some} experiments")
        day, proofs = _of_a_day(content, kind, setting)
        proof = next(iter(proofs.values()), None) or Proof.from_dict(content["proof"], setting)
        efforts = [
            LargestSensitivities.effort(setting, one, name)
            for one in (proofs.values() if proofs else (proof,))
        ]
        require(sum(efforts), "the multipliers and poses of its proof")
        exact = None
        if ON_CANDIDATES in content:
            if kind != "plan" or day is not None:
                message = "expected one in the certificate of a plan of m alone"
                raise ValueError(f"{ON_CANDIDATES}: {message}")
            exact = ExactOnCandidates.from_dict(content[ON_CANDIDATES], setting, proof)
        return cls(
            name=name,
            kind=kind,
            setting=setting,
            made=made,
            kept=kept,
            proof=proof,
            stated=dict(table(content["claims"], (), "claims", content["claims"])),
            sharing=_sharing(content, kind, setting),
            day=day,
            proofs=proofs,
            on_candidates=exact,
        )

    @property
    def degree(self) -> float:
        """Degree of homogeneity of the criterion's cost.

        Raises:
            ValueError: The criterion is a plug-in, of which no second implementation exists.
        """
        if self.name not in values.DEGREE:
            raise ValueError(f"the criterion {self.name} has no second implementation")
        return values.DEGREE[self.name]

    @property
    def candidates(self) -> int:
        """Number of candidates over which a bound is proved: the least of all proofs."""
        return min(one.candidates for one in (self.proof, *self.proofs.values()))

    @property
    def amounts_are_sound(self) -> bool:
        """Whether weights are shares of one, and repetitions whole numbers of at least one."""
        kept = _are_repeats(self.kept.amount)
        if self.kind == "plan":
            return kept and _are_repeats(self.made.amount)
        amount = self.made.amount
        return bool((amount >= 0).all() and abs(amount.sum() - 1) <= WEIGHTS_SUM)

    @cached_property
    def value(self) -> float:
        """The criterion as printed, of all experiments together.

        Raises:
            ValueError: It cannot be recomputed.
        """
        self._require_sound()
        return self._value_of(self.made)

    @property
    def value_exact(self) -> float:
        """That of the best known plan on candidates, with all that is known besides.

        Raises:
            ValueError: It cannot be recomputed, or there is none.
        """
        self._require_sound()
        if self.on_candidates is None:
            raise ValueError("there is no plan on candidates")
        return self._value_of(self.on_candidates.plan)

    def _value_of(self, made: Experiments) -> float:
        """The criterion of experiments, with the kept ones and what is known beforehand."""
        rows = (made + self.kept).stacked(self.setting, repeated=self.kind == "plan")
        rows = np.concatenate([rows, self._known])
        targets = self.setting.tasks.targets(self.name)
        return values.value(self.name, rows, targets, self.interest)

    @cached_property
    def largest(self) -> LargestSensitivities:
        """The largest sensitivities of the candidates and of further poses.

        Raises:
            ValueError: The multipliers prove nothing.
        """
        self._require_sound()
        return LargestSensitivities(
            setting=self.setting,
            proof=self.proof,
            multipliers=Multipliers.from_list(self.proof.multipliers, self.name, self.setting.p),
            prior=self._prior,
            per_trace=self.degree == 0,
            # The weights of a relaxation may be on poses that are no candidates. The bound holds
            # for them too, or else the design itself could beat it; so does that of a plan whose
            # bound is over candidates alone.
            own=self.made,
            own_count=self.kind == "relaxation" or "bound_searched" not in self.stated,
        )

    def bound(self, searched: bool) -> float:
        """The printed value that no design, or no plan of so many experiments, can beat.

        Args:
            searched: Whether the poses that the search has found count too.

        Raises:
            ValueError: The multipliers prove nothing.
        """
        if self.day is not None:
            return values.printed(self.name, self.of_day.cost(searched))
        found = self.largest
        t = found.searched if searched else found.proved
        cost = self._least_cost(found.multipliers.Z, t, self.proof.task_weights)
        if self.kind == "plan":
            cost *= self.made.amount.sum() ** -self.degree
        return values.printed(self.name, cost)

    @cached_property
    def bound_proved(self) -> float:
        """The printed value that no design, or no plan of so many experiments, in any poses beats.

        Raises:
            ValueError: The coverings prove nothing, or there are none.
        """
        self._require_sound()
        if self.proof.continuum is None or self.day is not None:
            raise ValueError("there is no covering of all poses")
        where = "proof.continuum"
        given = table(self.proof.continuum, ("multipliers", "coverings"), where, ("task_weights",))
        Z = Multipliers.from_list(given["multipliers"], self.name, self.setting.p)
        # Multipliers are read at unit size, by a power of two; limits are for the given ones.
        written = np.abs(np.array(given["multipliers"], dtype=float)).max(axis=(1, 2))
        size = np.abs(Z.Z).max(axis=(1, 2)) / written
        t = largest_sensitivities(
            given["coverings"], self.setting, Z, size, self._prior, per_trace=self.degree == 0
        )
        cost = self._least_cost(Z.Z, t, given.get("task_weights"))
        if self.kind == "plan":
            cost *= self.made.amount.sum() ** -self.degree
        return values.printed(self.name, cost)

    @property
    def known_to_all(self) -> Array:
        """Information (p, p) that every plan of as many new experiments has besides."""
        self._require_sound()
        return np.asarray(self._prior * self.made.amount.sum())

    @property
    def excess(self) -> float:
        """By how much a search of the check's own beats the sensitivities of the stated one.

        It is relative to them. Of O2, whose cost is of degree zero, they may be nearly zero, and
        nothing beside the multiplier: there it is the share by which the bound falls.

        Raises:
            ValueError: The multipliers prove nothing.
        """
        if self.day is not None:
            return self.of_day.excess
        largest = self.largest
        if self.degree:
            return largest.excess
        Z, shares = largest.multipliers.Z, self.proof.task_weights
        searched = self._least_cost(Z, largest.searched, shares)
        return searched / self._least_cost(Z, largest.climbed, shares) - 1

    @cached_property
    def of_day(self) -> DayBound:
        """The bound within a budget.

        Raises:
            ValueError: There is no budget, or the amounts are not sound.
        """
        self._require_sound()
        if self.day is None:
            raise ValueError("there is no budget")
        kept = self.kept.stacked(self.setting, repeated=True)
        return DayBound(
            name=self.name,
            degree=self.degree,
            setting=self.setting,
            day=self.day,
            proofs=self.proofs,
            made=self.made,
            known=np.concatenate([kept, self._known]),
            interest=self.interest,
        )

    def _least_cost(self, Z: Array, t: Array, task_weights: Any) -> float:
        """The cost that no design of one experiment beats whose sensitivities to Z are t (r,)."""
        rows = self.made.stacked(self.setting)
        # Only G needs the matrix itself, to find good weights; bad ones would prove less, not more.
        M = rows.T @ rows / self.made.amount.sum() + self._prior
        targets = self.setting.tasks.proving(self.name, task_weights, len(t))
        return lower_bound(self.name, Z, t, targets, M, self.interest)

    @property
    def interest(self) -> Array | None:
        """Combinations (p, s) that the criterion is about; None for all parameters."""
        # A target says by itself what is of interest.
        return None if self.name in values.OF_TARGET else self.setting.interest

    @cached_property
    def _prior(self) -> Array:
        """Information (p, p) of what is known besides, per new experiment."""
        kept = self.kept.stacked(self.setting, repeated=True)
        beside = np.concatenate([kept, self._known])
        return np.asarray(beside.T @ beside / self.made.amount.sum())

    @cached_property
    def _known(self) -> Array:
        """Whitened rows (N, p) of what is known beforehand, beside all experiments.

        The weights of a relaxation have the share of a single experiment.
        """
        if self.setting.prior is None:
            return np.empty((0, self.setting.p))
        return np.asarray(self.setting.prior / np.sqrt(self.sharing))

    def _require_sound(self) -> None:
        """Check that the criterion is known here, and that the amounts make sense."""
        _ = self.degree
        if not self.amounts_are_sound:
            raise ValueError("the weights or repetitions are not sound")


def _criterion_name(given: Any) -> str:
    """The name of a criterion, which is printed: it must hold no line that looks like a verdict."""
    is_name = isinstance(given, str) and given.isprintable() and 0 < len(given) <= LONGEST_LABEL
    if not is_name:
        raise ValueError("criterion: expected the name of a criterion")
    return str(given)


def _of_a_day(
    content: dict[str, Any], kind: str, setting: Setting
) -> tuple[Day | None, dict[tuple[int, ...], Proof]]:
    """What a day may cost, and a proof for each set of loads that it pays for; none without."""
    if "day" not in content:
        return None, {}
    day = Day.from_dict(content["day"])
    if kind != "plan":
        raise ValueError("day: expected one in the certificate of a plan alone")
    return day, read_proofs(content["proof"], setting)


def _sharing(content: Any, kind: str, setting: Setting) -> int:
    """How many experiments share what is known beforehand; one where the amounts tell."""
    if kind == "plan" or setting.prior is None:
        if "sharing" in content:
            raise ValueError("sharing: expected none but in a relaxation with a prior")
        return 1
    if "sharing" not in content:
        raise ValueError("certificate: the key 'sharing' is missing")
    return whole(content["sharing"], 1, int(MOST_REPEATS), "sharing")


def _are_repeats(amount: Array) -> bool:
    """Whether all are whole numbers from one on."""
    whole = amount == np.round(amount)
    return bool((whole & (amount >= 1) & (amount <= MOST_REPEATS)).all())
