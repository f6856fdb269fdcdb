"""Text of a sampled posterior."""

from edtk.inference.posterior import Posterior


def posterior(found: Posterior) -> str:
    """The headline, and a row a compliance with its 95 % interval [rad/(N m)]."""
    table = found.to_frame().to_string(index=False, float_format="{:.4g}".format)
    return f"{found.headline()}\n{table}"
