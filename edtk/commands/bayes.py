"""`edtk bayes`: the sampled posterior of a plan beside Eq. (13)."""

import json
import math
from pathlib import Path
from typing import Any

import click

from edtk.commands.sampling import Sampling, sampling_options
from edtk.commands.shared import FilePath
from edtk.system.atomic_file import require_writable


class _Number(click.ParamType[Any]):
    """A positive number, possibly inf, or one of some words."""

    def __init__(self, *words: str, least: float = 0.0) -> None:
        self.words, self.least, self.name = words, least, "|".join(("number", *words))

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> object:
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
                f"expected a number {least}{''.join(f' or {w!r}' for w in self.words)}, got {value!r}",
                param,
                ctx,
            )
        return number


@click.command("bayes")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option(
    "--sigma-factor",
    type=_Number(least=1.0),
    help="Sigma is known to that factor: 1, or inf for not at all.",
)
@click.option(
    "--nu",
    type=_Number("normal", "sampled"),
    metavar="NUMBER|normal|sampled",
    help="Student-t errors with so many degrees of freedom.",
)
@sampling_options
@click.option(
    "--figures", type=click.Path(path_type=Path, file_okay=False), help="Folder for pictures (PNG)."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
def command(
    study: Path,
    plan: Path,
    sigma_factor: float | None,
    nu: float | str | None,
    sampling: Sampling,
    figures: Path | None,
    as_json: bool,
) -> None:
    """Simulate measurements of PLAN, sample the posterior of the compliances, compare with Eq. (13).

    What is known before the measurements is the [prior] of STUDY (TOML). A killed run with --chain goes on where it
    was when it is started again.
    """
    from edtk.calibration.check_plan_posterior import check_plan_posterior
    from edtk.calibration.export_inference_data import export_inference_data
    from edtk.inference.noise import NU_IN_WORDS, Noise
    from edtk.study.study import load_study

    loaded = load_study(study)
    sampling.require_writable(*loaded.reads, plan)
    given = loaded.specification.prior.noise()
    degrees = given.nu if nu is None else NU_IN_WORDS[nu] if isinstance(nu, str) else nu
    noise = Noise(given.sigma_factor if sigma_factor is None else sigma_factor, degrees)
    loaded_plan = loaded.load_plan(plan)
    if figures is not None:
        require_writable(figures / "corner.png")
    with sampling.arguments(plan, loaded.specification.seed) as arguments:
        check = check_plan_posterior(loaded, loaded_plan, noise=noise, **arguments)
    if sampling.export is not None:
        export_inference_data(check, sampling.export, loaded.target)
    if figures is not None:
        from edtk.report.posterior_figures import draw_figures

        draw_figures(check, figures)
    click.echo(json.dumps(check.to_dict(), indent=2) if as_json else check.summary())
