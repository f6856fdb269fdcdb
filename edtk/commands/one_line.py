"""Commands that answer every mistake of a user with one line."""

import sys
from typing import Any

import click

import criteria
from edtk.system.errors import ArgumentError, UserError

FLAGS = {"memory_mb": "--memory"}  # of arguments whose flags have other names


class OneLine(click.Command):
    """Mixin for a click command: one line on standard error, exit code 2, and never a traceback, for a mistake."""

    program = "edtk"

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run and exit; with code 130 where the user interrupts."""
        kwargs["standalone_mode"] = False
        code = 2
        try:
            sys.exit(super().main(*args, **kwargs) or 0)
        except click.ClickException as error:
            message = error.format_message()
        except click.Abort:
            message, code = "interrupted", 130
        except ArgumentError as error:
            flag = FLAGS.get(error.argument, f"--{error.argument}")
            message = str(error.naming(flag))
        except (UserError, criteria.CriterionError) as error:
            message = str(error)
        except OSError as error:
            message = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        click.echo(f"{self.program}: {' '.join(message.split())}", err=True)
        sys.exit(code)
