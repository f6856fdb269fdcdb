"""Readings of the columns that explain measurements which do not fit as they are."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.finding import Finding, Kind
from edtk.calibration.input_errors.reading import Reading
from edtk.calibration.input_errors.readings import readings
from edtk.calibration.input_errors.refit import Refit
from edtk.calibration.some_rows import some_rows
from edtk.inference.identification import Identification
from edtk.inference.measurements import Measurements
from edtk.study.study import Study

SUSPECT = 3.0  # residuals over sigma beyond which other readings are tried
BETTER = 3.0  # factor by which another reading must reduce the residuals
LEAST_P = 1e-3  # probability of its residuals below which a reading does not explain them
LIKELY = 1e3  # ratio of likelihoods up to which the best reading is not better than another
LEAST_FREEDOM = 3  # degrees of freedom from which residuals tell a good reading from a bad one
BY_FAR = -3.0  # standard deviations below zero that no compliance can have
MOST_CORRECTED = 12  # readings, the best ones, whose equilibrium is computed
ENOUGH = 1000  # rows on which readings are compared


@dataclass(frozen=True, eq=False)
class Explanation:
    """Measurements that do not fit as they are read, and the readings that do.

    Attributes:
        given: The fit of the columns as they are headed.
        refits: The readings that fit much better and about equally well, the likeliest first;
            empty where no reading does.
    """

    given: Refit
    refits: tuple[Refit, ...]

    @property
    def certain(self) -> bool:
        """Whether the noise explains what a reading leaves."""
        return any(refit.p > LEAST_P for refit in self.refits)

    @property
    def finding(self) -> Finding | None:
        """The reading as a finding, or several of them; None where no reading fits."""
        if not self.refits:
            return None
        first = self.refits[0].reading.finding
        numbers = {
            "before": self.given.size,
            "after": self.refits[0].size,
            "explained": 1 - self.refits[0].chi2 / self.given.chi2,
            "left_out": self.refits[0].left_out,
        }
        if len(self.refits) == 1:
            return Finding(first.kind, columns=first.columns, data={**first.data, **numbers})
        several = tuple(refit.reading.finding for refit in self.refits)
        return Finding(Kind.SEVERAL_READINGS, data={"readings": several, **numbers})


def explanation(study: Study, data: Measurements, fit: Identification) -> Explanation | None:
    """Read measurements that do not fit in other ways.

    Args:
        study: The model.
        data: The measurements as the columns are headed.
        fit: Their fit.

    Returns:
        The readings that explain them; None where they fit as they are, or where there are too few
        to tell a reading that fits from one that does not.
    """
    only_signs = fit.dof < LEAST_FREEDOM
    if only_signs and not (fit.unbounded < BY_FAR * fit.std).all():
        return None
    if len(data) > ENOUGH:
        data = data[some_rows(len(data), ENOUGH)]
    given = Refit.of(study, Reading(Finding(Kind.AS_GIVEN), data))
    if not SUSPECT < given.size < np.inf:
        return None
    given = given.corrected(study)
    if not given.size > SUSPECT:
        return None
    tried = [Refit.of(study, reading) for reading in readings(study, data, only_signs)]
    return Explanation(given, _equally_good(study, tried, given.size / BETTER))


def _equally_good(study: Study, tried: list[Refit], most: float) -> tuple[Refit, ...]:
    """The readings whose residuals are at most so large, and about as small as the best one's."""
    better = [refit for refit in tried if refit.size <= most]
    if not better:
        return ()
    enough = sorted(refit.chi2 for refit in better)[:MOST_CORRECTED][-1]
    corrected = [refit.corrected(study) for refit in better if refit.chi2 <= enough]
    found = [refit if refit.p > LEAST_P else refit.without_outliers(study) for refit in corrected]
    best = min(refit.cost for refit in found)
    equal = [refit for refit in found if refit.cost <= best + 2 * np.log(LIKELY)]
    equal = [refit for refit in equal if refit.size <= SUSPECT]
    return tuple(refit for refit in equal if not any(_is_simpler(other, refit) for other in equal))


def _is_simpler(other: Refit, refit: Refit) -> bool:
    """Whether another reading changes only some of the columns that a reading changes."""
    fewer = other.reading.finding
    more = refit.reading.finding
    return fewer.kind is more.kind and set(fewer.columns) < set(more.columns)
