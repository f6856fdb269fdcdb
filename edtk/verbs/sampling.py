"""Options of the verbs that sample a posterior, and the checks that come before long work."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from edtk.system.errors import UserError
from edtk.verbs.require_output import require_file, require_output


@dataclass(frozen=True)
class Sampling:
    """How a posterior is sampled.

    Attributes:
        accuracy: Monte-Carlo error of every standard deviation, relative to it, at most; None for
            0.01.
        most: Limit on the steps of the chain; None for 60000.
        chain: File that keeps the chain (HDF5), and from which sampling goes on; None for none.
        export: File for ArviZ InferenceData (NetCDF), "-" for standard output; None for none.
        seed: Seed; None for the study's.
        progress: Called with the number of steps so far.
    """

    accuracy: float | None = None
    most: int | None = None
    chain: Path | str | None = None
    export: Path | str | None = None
    seed: int | None = None
    progress: Callable[[int], object] = lambda steps: None

    def require_writable(self, *inputs: Path | str | None) -> None:
        """Check that both files can be written, are no inputs, and that ArviZ is installed.

        Raises:
            UserError: A file is an input, or ArviZ is missing.
            OSError: A file cannot be written.
        """
        from edtk.calibration.inference_data import require_arviz

        require_file(self.chain)
        if self.export is not None:
            require_arviz(self.export)
        for path in (self.chain, self.export):
            require_output(path, *inputs)
        require_output(self.export, self.chain)

    @contextmanager
    def arguments(self, source: Path, study_seed: int) -> Iterator[dict[str, Any]]:
        """Arguments of a posterior check; errors of the sampler name the input.

        Args:
            source: The file, or the word, that begins a message.
            study_seed: Seed of the study, for where no seed is given.

        Raises:
            UserError: The chain does not converge, cannot be kept, or has no proper posterior.
        """
        from edtk.inference.chain_file import ChainFileError
        from edtk.inference.least_squares import SingularPlanError
        from edtk.inference.run_chain import Demand, UnconvergedError
        from edtk.inference.sample_posterior import ImproperPosteriorError, SamplingOptions

        default = Demand()
        demand = Demand(
            self.accuracy or default.accuracy, default.length, self.most or default.most
        )
        seed = study_seed if self.seed is None else self.seed
        try:
            chain = None if self.chain is None else Path(self.chain)
            options = SamplingOptions(demand, chain, self.progress)
            yield {"rng": np.random.default_rng(seed), "options": options}
        except (SingularPlanError, ImproperPosteriorError, UnconvergedError) as error:
            raise UserError(str(error), where=source) from error
        except ChainFileError as error:
            raise UserError(str(error)) from error
