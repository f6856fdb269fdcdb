"""The command `edtk`: JSON alone on standard output, messages on standard error."""

import click

from edtk.commands import (
    bayes,
    bias,
    check,
    compensate,
    controller,
    criteria,
    evaluate,
    identify,
    new,
    plan,
    predict,
    relax,
    robot,
    run,
    show,
    template,
    verify,
)
from edtk.commands.shared import OneLine
from edtk.version import __version__

COMMANDS = (
    robot,
    new,
    controller,
    plan,
    run,
    relax,
    evaluate,
    check,
    show,
    template,
    identify,
    predict,
    compensate,
    bias,
    bayes,
    verify,
    criteria,
)


class _Group(OneLine, click.Group):
    """The program: a group of commands, listed in the order of a day's work."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands in the order in which they are used."""
        return list(self.commands)


@click.group(
    cls=_Group, context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False
)
@click.version_option(__version__, prog_name="edtk")
def main() -> None:
    """Plan the calibration of a robot, identify it from the sheet, and say how good both are."""


for module in COMMANDS:
    main.add_command(module.command)
