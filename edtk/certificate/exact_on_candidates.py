"""The part of a plan's certificate about all plans of whole experiments on its candidates."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.proof import LARGEST, Experiments, Proof
from edtk.certificate.recompute import values
from edtk.certificate.recompute.array_criteria import FORMS, Part
from edtk.certificate.recompute.arrays import LONG, Candidates
from edtk.certificate.recompute.candidates import candidates
from edtk.certificate.recompute.exact_tree import Tree, plan_of
from edtk.certificate.recompute.plain_data import number, table, whole
from edtk.certificate.recompute.setting import Setting
from edtk.system.typing import Array, Indices

KEYS = ("candidates", "plan", "value", "bound_exact", "proved_exact", "tree")
WHERE = "on_candidates"
MOST_NUMBERS = 2e7  # in the information of all candidates together


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
        content = table(content, KEYS, WHERE)
        n = whole(content["candidates"], 1, LARGEST, f"{WHERE}.candidates")
        if n * setting.p * max(setting.p + 1, 2 * len(setting.sigma)) > 2 * MOST_NUMBERS:
            raise ValueError(f"{WHERE}: {n} candidates are more than are computed here")
        if not isinstance(content["proved_exact"], bool):
            raise ValueError(f"{WHERE}.proved_exact: expected true or false")
        table(content["plan"], ("candidate", "count"), f"{WHERE}.plan")
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
            stated={name: number(content[name], f"{WHERE}.{name}") for name in names}
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
