"""The chain of a posterior, step by step."""

import numpy as np

from edtk.report.draw.labelled_samples import LabelledSamples
from edtk.report.palette import BLUE, ORANGE

MOST_STEPS = 1000  # that are drawn


def trace(shown: LabelledSamples, last_step: int, axes: np.ndarray) -> None:
    """Draw every walker against the steps after burn-in, and the ensemble's mean.

    Args:
        shown: The samples.
        last_step: Number of the last step.
        axes: Axes (d,), one for each unknown.
    """
    count = len(shown.samples)
    every = max(1, count // MOST_STEPS)
    steps = np.arange(count)[::every] + last_step - count
    for i, ax in enumerate(axes):
        walkers = shown.samples[::every, :, i]
        ax.plot(steps, walkers, color=BLUE, linewidth=0.3, alpha=0.25, rasterized=True)
        ax.plot(steps, walkers.mean(axis=1), color="black", linewidth=0.8)
        ax.axhline(shown.reference[i], color=ORANGE, linewidth=1)
        ax.set_ylabel(shown.labels[i], fontsize=8)
        ax.tick_params(labelsize=7)
        ax.margins(x=0)
    axes[-1].set_xlabel("step")
