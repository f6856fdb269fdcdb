"""A plan of whole experiments beside the bound that no such plan can beat."""

from typing import Protocol

from edtk.design.bound import Bound, printed_form
from edtk.system.presented import Presented


class _Bounded(Protocol):
    """What a plan has to say of itself."""

    @property
    def cost(self) -> float: ...

    @property
    def lower_bound(self) -> Bound: ...


class BoundedPlan(Presented):
    """A result with the `cost` of all its experiments and the `lower_bound` of every such plan."""

    @property
    def value(self: _Bounded) -> float:
        """The criterion as its formula prints it, of all experiments together."""
        return printed_form(self.cost, self.lower_bound.sense)

    @property
    def bound(self: _Bounded) -> float:
        """The bound in the criterion's printed form."""
        return self.lower_bound.value

    @property
    def efficiency(self: _Bounded) -> float:
        """``bound / cost`` as costs: one for a plan that cannot be improved."""
        return self.lower_bound.efficiency(self.cost)
