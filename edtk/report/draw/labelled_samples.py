"""Samples of a posterior in units that a person reads."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.draw.short_names import short_names
from edtk.report.plain import plain
from edtk.system.typing import Array

NOISE_LABELS = {"sigma_ratio": "sigma ratio", "nu": "log10 nu"}


@dataclass(frozen=True, eq=False)
class LabelledSamples:
    """Compliances, and the unknowns of the noise.

    Attributes:
        labels: Names with units (d,).
        samples: Samples (steps, walkers, d); nu as its logarithm.
        reference: Values (d,) to compare with; NaN without one.
    """

    labels: list[str]
    samples: Array
    reference: Array

    @classmethod
    def of(cls, check: PosteriorCheck) -> "LabelledSamples":
        """The samples of a posterior, compliances in powers of a thousand of their unit."""
        posterior = check.posterior
        power = 3 * np.floor(np.log10(posterior.mean) / 3 + 1e-9)
        names = short_names(list(check.table["parameter"]))
        labels = [
            f"{plain(name)}\n[$10^{{{int(exponent)}}}$ {unit}]"
            for name, exponent, unit in zip(names, power, check.table["unit"], strict=True)
        ]
        reference = check.table["reference"].to_numpy(dtype=float) / 10.0**power
        columns = [posterior.samples / 10.0**power]
        known = check.reference == "assumed truth"
        noise_reference = []
        for i, name in enumerate(posterior.noise_names):
            column = posterior.noise[..., i : i + 1]
            columns.append(np.log10(column) if name == "nu" else column)
            noise_reference.append(1.0 if known and name == "sigma_ratio" else np.nan)
            labels.append(NOISE_LABELS[name])
        samples = np.concatenate(columns, axis=-1)
        return cls(labels, samples, np.array([*reference, *noise_reference]))
