"""Design spaces whose measurements have a tracker's noise, joints that repeat badly, and a wrong
model.
"""

from dataclasses import replace

import numpy as np
from designs import DESIGNS

from edtk.design.design_space import DesignSpace
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.model_error import ModelError, groups_of
from edtk.measure.noise import Tracker, VisitNoise
from edtk.robots.frames import BodyPoint
from edtk.robots.loads.free_load import FreeLoad

TRACKER = Tracker(np.array([6.0, -4.0, 1.5]), (2e-5, 1e-5), (4e-5, 1.5e-5))


def noisy(
    space: DesignSpace,
    discrepancy: float = 2e-4,
    repeatability: float = 3e-5,
    share: float = 0.0,
) -> DesignSpace:
    """The same space with noise of all kinds, and springs that are not ideal by a share."""
    model = space.model
    rows = [sensor.rows for sensor in model.instruments]
    first = np.cumsum([0, *rows[:-1]])
    seen = [
        (i, int(row))
        for i, row in enumerate(first)
        if not isinstance(model.instruments[i], Distance)
    ]
    white = np.full(sum(rows), 1e-5)
    own = np.full(sum(rows), discrepancy)
    if model.rows == "pose" and not model.sensors:
        white[3:] = space.sigma[3:]
        own[3:] = 0.0
    joints = repeatability * (1 + np.arange(model.robot.n) % 3)
    noise = VisitNoise(TRACKER, tuple(seen), joints, white, own, within=np.deg2rad(5.0))
    if share:
        k = 1e-6 * (1 + np.arange(model.robot.n) % 4)
        groups = groups_of(model.whole_instruments)
        noise = replace(noise, error=ModelError(k, share, 0.6 * share), groups=groups)
    return replace(space, noise=noise)


def marked(space: DesignSpace) -> DesignSpace:
    """The same space with three markers on the tool and a draw wire."""
    offsets = ([0.0, 0.0, 0.0], [0.1, 0.2, 0.05], [-0.15, 0.1, 0.2])
    sensors = (
        *(Marker(BodyPoint(np.array(offset))) for offset in offsets),
        Distance(BodyPoint(np.array([0.05, 0.0, 0.1])), anchor=np.array([0.5, 3.0, 0.2])),
    )
    model = ElastostaticModel(space.model.robot, space.model.unknown, sensors=sensors)
    return replace(space, model=model, sigma=np.full(10, 3e-5))


NOISY = {name: noisy(space) for name, space in DESIGNS.items()}
NOISY["three markers and a wire"] = noisy(marked(DESIGNS["kr270"]))
NOISY["springs that are not ideal"] = noisy(marked(DESIGNS["kr270"]), share=0.1)
NOISY["a free load on them"] = noisy(
    replace(DESIGNS["kr270"], load=FreeLoad(2500.0)), discrepancy=0.0, share=0.1
)
NOISY["odd springs"] = noisy(DESIGNS["odd"], share=0.2)
