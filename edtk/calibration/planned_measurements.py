"""The measurements that a plan will bring, without their values."""

import numpy as np

from edtk.calibration.stated_noise import stated_noise
from edtk.design.plan import Plan
from edtk.inference.measurements import Measurements
from edtk.inference.sheet_sensors import sheet_turns
from edtk.study.study import Study
from edtk.study.study_model import study_sigma
from edtk.system.typing import Indices


def planned_measurements(study: Study, plan: Plan) -> Measurements:
    """Poses, loads and noise of a plan: a row for each pose, and instrument if there are several.

    Repetitions count as one measurement of less noise, ``sigma / sqrt(repeats)``, so that very many
    are not expanded; of a discrepancy that they share they do not lessen.

    Args:
        study: Says which rows are measured, and their noise. Its instruments measure as many rows
            each.
        plan: The experiments.
    """
    if study.noise is not None:
        visits = _of_sensors(study, plan, np.ones_like(plan.repeats))
        return stated_noise(study, visits, _of_instruments(study, plan.repeats))
    if study.model.sensors:
        return _of_sensors(study, plan, plan.repeats)
    poses = len(plan.q)
    sigma = study.sigma / np.sqrt(plan.repeats[:, None].astype(float))
    nothing = np.zeros((poses, len(study.sigma)))
    return Measurements(
        plan.q, plan.wrench, nothing, sigma, np.zeros((poses, 3)), absolute=study.is_absolute
    )


def _of_instruments(study: Study, values: Indices) -> Indices:
    """Values (poses,) for each instrument in each pose."""
    return np.repeat(values, len(study.model.instruments))


def _of_sensors(study: Study, plan: Plan, repeats: Indices) -> Measurements:
    """The same where markers or distances are measured: all of them in each pose."""
    sensors = study.model.instruments
    poses = len(plan.q)
    each = np.split(study_sigma(study), len(sensors))
    sigma = np.tile(each, (poses, 1)) / np.sqrt(_of_instruments(study, repeats))[:, None]
    offsets = [sensor.point.offset for sensor in sensors]
    index = np.tile(np.arange(len(sensors)), poses)
    return Measurements(
        np.repeat(plan.q, len(sensors), axis=0),
        np.repeat(plan.wrench, len(sensors), axis=0),
        np.zeros_like(sigma),
        sigma,
        np.tile(offsets, (poses, 1)),
        sensor=index,
        turn=sheet_turns(sensors, index),
        absolute=study.is_absolute,
    )
