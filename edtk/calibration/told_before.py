"""What a study of geometry knows of its parameters before it measures them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from edtk.calibration.result_file import MOST_MB, read_geometry
from edtk.fit.fitted_geometry import FittedGeometry
from edtk.fit.prior import Flat, Marginal, Normal, Prior
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import Parameter
from edtk.study.study_geometry import StudyGeometry
from edtk.study.study_parts import study_prior
from edtk.system.errors import UserError
from edtk.system.files import read_text
from edtk.system.parsing import parse_json
from edtk.system.typing import Array

KEY = "prior.earlier_file"
PLACES = ("joint", "compliance", "spring")  # of an earlier day, that are the same on another one


def told_before(setting: StudyGeometry) -> Prior:
    """What is known of all parameters of a study's model: densities, and an earlier calibration.

    A known compliance is a parameter of which N(v, s^2) is known. An earlier calibration of
    geometry tells of joints and springs; where base and markers were then, tells nothing of today.

    Args:
        setting: The study, and its markers.

    Raises:
        UserError: The study's prior is not one, or its file cannot be read.
    """
    model = setting.model
    earlier = _earlier_result(setting)
    if earlier is None:
        return _of_compliances(setting, model)
    fitted, counted = earlier
    prior = Prior(tuple(_density(setting, one) for one in model.parameters), positive=False)
    # The result rests on its own densities already.
    marginals = tuple(
        Flat() if one.name in counted else own
        for one, own in zip(model.parameters, prior.marginals, strict=True)
    )
    return replace(prior, marginals=marginals, earlier=_normal(setting, model, fitted))


def design_prior(setting: StudyGeometry) -> Prior:
    """What counts in designs: known compliances always, the rest where the study asks for it.

    Raises:
        UserError: The prior is to count, and says nothing; or it is none.
    """
    table = setting.study.specification.prior
    if table.in_design:
        prior = told_before(setting)
        if prior.is_flat:
            raise setting.study.error(
                "prior.in_design",
                "the prior says nothing about any parameter; expected an earlier calibration, or "
                "densities that are not flat",
            )
        return prior
    known = setting.uncertain
    marginals = [
        known.get(one.of, Flat()) if one.place == "compliance" else Flat()
        for one in setting.model.parameters
    ]
    return Prior(tuple(marginals), positive=False)


def _of_compliances(setting: StudyGeometry, model: MeasuredModel) -> Prior:
    """Densities, and an earlier calibration of the compliances alone."""
    marginals = tuple(_density(setting, one) for one in model.parameters)
    own = study_prior(setting.study).earlier if setting.study.specification.joints.unknown else None
    if own is None:
        return Prior(marginals, positive=False)
    place = {one.of: i for i, one in enumerate(model.parameters) if one.place == "compliance"}
    basis = tuple(place[name] for name in setting.study.specification.joints.unknown)
    columns = np.eye(model.p)[list(basis)]
    return Prior(marginals, Normal(own.mean, own.covariance, columns, basis), positive=False)


def _density(setting: StudyGeometry, one: Parameter) -> Marginal:
    """What the study says of one parameter; of several entries that which means fewest counts."""
    table = setting.study.specification.prior
    if one.place == "compliance":
        known = setting.uncertain.get(one.of)
        return table.joints.get(one.of, table.all).build() if known is None else known
    if one.place == "spring":
        own = one.name.removeprefix("k_")
        return table.joints[own].build() if own in table.joints else Flat()
    for name in one.groups:
        if name in table.parameters:
            return table.parameters[name].build(one.turns)
    return Flat()


def _earlier_result(setting: StudyGeometry) -> tuple[FittedGeometry, frozenset[str]] | None:
    """An earlier result of geometry, and the parameters whose densities it rests on; or None.

    Raises:
        UserError: The file is no result, or one of another study.
    """
    study = setting.study
    name = study.specification.prior.earlier_file
    if name is None:
        return None
    try:
        path = study.folder / name
        content: Any = parse_json(read_text(path, MOST_MB), path)
        geometry = content.get("geometry") if isinstance(content, Mapping) else None
        if not isinstance(geometry, Mapping):
            return None
        _, fitted, _ = read_geometry(study, geometry, path)
    except UserError as error:
        place = name if error.key is None else f"{name}: {error.key}"
        raise study.error(KEY, f"{place}: {error.message}") from error
    counted = geometry.get("told_before", [])
    return fitted, frozenset(map(str, counted if isinstance(counted, list) else []))


def _normal(setting: StudyGeometry, model: MeasuredModel, fitted: FittedGeometry) -> Normal:
    """The estimates of joints and springs, with base and markers left open.

    Raises:
        UserError: They have no covariance that can be inverted.
    """
    names = [one.name for one in model.parameters]
    basis = tuple(names.index(one.name) for one in fitted.model.parameters)
    opened = [names.index(one.name) for one in fitted.open_parameters]
    every = np.zeros((len(basis), model.p))
    every[range(len(basis)), list(basis)] = 1.0
    scales = fitted.model.scales
    # An estimate is of its parameter and the shares of those that were open.
    shares: Array = fitted.shares * scales[:, None] / model.scales[opened]
    every[:, opened] = shares
    own = np.array([one.place in PLACES for one in fitted.model.parameters], dtype=bool)
    every[:, [i for i, one in enumerate(model.parameters) if one.place not in PLACES]] = 0.0
    covariance = fitted.covariance * np.outer(scales, scales)
    try:
        return Normal(fitted.theta[own], covariance[np.ix_(own, own)], every[own], basis)
    except np.linalg.LinAlgError:
        message = "expected a result with joints or springs, and a positive definite covariance"
        raise setting.study.error(KEY, message) from None
