"""What loads the joints of a chain, besides the wrench itself."""

from dataclasses import dataclass, field

from edtk.model.body_point import BodyPoint
from edtk.model.dead_weights import DeadWeights


@dataclass(frozen=True, eq=False)
class Loading:
    """Where a wrench acts, and what else loads the joints.

    Attributes:
        point: Where the wrench acts; the tool point by default.
        weights: Weights that hang on the arm; None for none.
    """

    point: BodyPoint = field(default_factory=BodyPoint)
    weights: DeadWeights | None = None

    @property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames are needed, see `Robot.frames`."""
        return (*self.point.bodies, *(self.weights.bodies if self.weights else ()))
