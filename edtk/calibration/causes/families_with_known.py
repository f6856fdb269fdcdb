"""The faults that are tried where some compliances are known, or something is known of all."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.families import PERCENT, families
from edtk.calibration.causes.family import Family
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

USUAL_SIZE = 0.1  # of a load that nobody weighed


def families_with_known(
    model: ElastostaticModel,
    data: Measurements,
    A: Array,
    k: Array,
    known: Mapping[int, float],
    told: bool = False,
) -> Iterator[Family]:
    """List faults of the whole experiment, which change what known joints do, too.

    Unknown compliances take up a load of another size in full. Only where the compliance of some
    joint is known, or something is known of the unknown ones, or weights load the joints besides,
    such a load is seen.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        A: Their regressors (m, rows, p) in this model.
        k: Fitted compliances (p,) [rad/(N m)].
        known: Compliances of further joints, by their index [rad/(N m)].
        told: Whether something is known of the size of the unknown compliances.
    """
    if not known:
        yield from families(model, data, A, k)
        if told or model.weights is not None:
            yield _load_size(model, data)
        return
    every = replace(model, unknown=(*model.joints, *known))
    whole = data.regressor(every)
    values = np.array(list(known.values()))
    for family in (*families(every, data, whole, np.append(k, values)), _load_size(every, data)):
        yield _of_unknown(family, whole, values)


def _load_size(model: ElastostaticModel, data: Measurements) -> Family:
    """The load is larger or smaller than stated, by a share; weights of links are not."""

    def predict(c: Array) -> tuple[Array, Array]:
        other = replace(data, wrench=data.wrench * (1 + c[0]))
        return other.regressor(model), np.zeros(data.deflection.shape)

    return Family("load_size", "%", PERCENT, 1, USUAL_SIZE, predict)


def _of_unknown(family: Family, whole: Array, values: Array) -> Family:
    """A fault of all joints as one of the unknown ones, beside what known joints do without it.

    Args:
        family: The fault, with the known joints behind the unknown ones.
        whole: Regressors (m, rows, p + n) of all of them without the fault.
        values: The known compliances (n,) [rad/(N m)].
    """
    p = whole.shape[-1] - len(values)

    def predict(c: Array) -> tuple[Array, Array]:
        A, b = family.predict(c)
        return A[..., :p], b + (A[..., p:] - whole[..., p:]) @ values

    return replace(family, predict=predict)
