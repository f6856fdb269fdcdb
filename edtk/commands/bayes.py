"""`edtk bayes`: the sampled posterior of a plan beside Eq. (13)."""

import json
import math
import sys
from pathlib import Path
from typing import Any

import click
import numpy as np
from tqdm import tqdm

from edtk.atomic import require_writable
from edtk.errors import UserError

FilePath = click.Path(path_type=Path, dir_okay=False)


class _Number(click.ParamType[Any]):
    """A positive number, possibly inf, or one of some words."""

    def __init__(self, *words: str, least: float = 0.0) -> None:
        self.words, self.least, self.name = words, least, "|".join(("number", *words))

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> object:
        """The word, or the number."""
        if value in self.words:
            return value
        try:
            number = float(str(value))
        except ValueError:
            number = math.nan
        if not (number > 0 and number >= self.least):
            least = f"of at least {self.least:g}" if self.least else "above zero"
            self.fail(
                f"expected a number {least}{''.join(f' or {w!r}' for w in self.words)}, got {value!r}", param, ctx
            )
        return number


@click.command("bayes")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option(
    "--sigma-factor", type=_Number(least=1.0), help="Sigma is known to that factor: 1, or inf for not at all."
)
@click.option("--nu", type=_Number("normal", "sampled"), help="Student-t errors with so many degrees of freedom.")
@click.option(
    "--accuracy",
    type=click.FloatRange(min=1e-4, max=0.5),
    default=0.01,
    show_default=True,
    help="Monte-Carlo error of standard deviations, relative.",
)
@click.option("--most", type=click.IntRange(min=1), default=60_000, show_default=True, help="Limit on steps.")
@click.option("--chain", type=FilePath, help="Keep the chain (HDF5), and go on with what is there.")
@click.option("--export", "nc", type=FilePath, help="Write ArviZ InferenceData (NetCDF).")
@click.option("--figures", type=click.Path(path_type=Path, file_okay=False), help="Folder for pictures (PNG).")
@click.option("--seed", type=click.IntRange(min=0), help="Seed [default: the study's].")
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
def command(
    study: Path,
    plan: Path,
    sigma_factor: float | None,
    nu: float | str | None,
    accuracy: float,
    most: int,
    chain: Path | None,
    nc: Path | None,
    figures: Path | None,
    seed: int | None,
    as_json: bool,
) -> None:
    """Simulate measurements of PLAN, sample the posterior of the compliances, compare with Eq. (13).

    What is known before the measurements is the [prior] of STUDY (TOML). A killed run with --chain goes on where it
    was when it is started again.
    """
    from edtk.inference import Noise, SingularPlanError
    from edtk.inference.chain import Demand
    from edtk.inference.chain_file import ChainFileError
    from edtk.inference.posterior import ImproperPosteriorError, UnconvergedError
    from edtk.study import load_study
    from edtk.study.bayes import bayes_check
    from edtk.study.inference_data import export, require_arviz

    loaded = load_study(study)
    given = loaded.file.prior.noise()
    words = {"normal": math.inf, "sampled": None}
    degrees = given.nu if nu is None else words[nu] if isinstance(nu, str) else nu
    noise = Noise(given.sigma_factor if sigma_factor is None else sigma_factor, degrees)
    rng = np.random.default_rng(loaded.file.seed if seed is None else seed)
    if nc is not None:
        require_arviz(nc)
    for path in (chain, nc, figures / "corner.png" if figures is not None else None):
        if path is not None:
            require_writable(path)
    with tqdm(unit="step", file=sys.stderr, desc="emcee") as bar:
        try:
            check = bayes_check(
                loaded,
                loaded.load_plan(plan),
                rng,
                lambda n: bar.update(n - bar.n),
                noise=noise,
                demand=Demand(accuracy, most=most),
                chain=chain,
            )
        except (UnconvergedError, SingularPlanError, ImproperPosteriorError) as error:
            raise UserError(f"{plan}: {error}") from error
        except ChainFileError as error:
            raise UserError(str(error)) from error
    if nc is not None:
        export(check, nc)
    if figures is not None:
        from edtk.study.posterior_figures import draw_figures

        draw_figures(check, figures)
    click.echo(json.dumps(check.to_json(), indent=2) if as_json else check.summary())
