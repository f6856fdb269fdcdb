"""Commands that answer every error of a user with one line."""

import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click

from edtk.system.errors import ArgumentError, UserError, shortened
from edtk.system.interruptible import leave
from edtk.system.note import Note

USER_ERROR = 2  # exit code
INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it


FLAGS = {"memory_mb": "--memory"}  # of arguments whose flags have other names
# Options that help where the library raises an error of this class: only commands know a flag.
HINTS = {
    "InputError": "; --as-is takes it as it is",
    "UnconvergedError": " with --most, or expect less with --accuracy",
    "SigmaTooSmallError": ", or --sigma-unknown",
}


class OneLine(click.Command):
    """Mixin for a click command: an error of the user is one line, and never a traceback."""

    program = "edtk"

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the command and exit: with code 2 after an error of the user, 130 after Ctrl-C.

        SIGTERM, by which schedulers and containers end a program, is taken like Ctrl-C.
        """
        kwargs["standalone_mode"] = False
        code = USER_ERROR
        try:
            with _sigterm_like_ctrl_c(), _notes_at_the_end(self.program):
                code = super().main(*args, **kwargs) or 0
            leave(code)
        except click.ClickException as error:
            message = " ".join(error.format_message().split())  # click lists choices a line each
        except click.Abort:
            message = "interrupted"
            code = INTERRUPTED
        except ArgumentError as error:
            flag = FLAGS.get(error.argument, f"--{error.argument.replace('_', '-')}")
            message = str(error.naming(flag))
        except UserError as error:
            kinds = (type(error).__name__, type(error.__cause__).__name__)
            message = str(error) + "".join(HINTS.get(kind, "") for kind in kinds)
        except LookupError as error:
            # Imported late: the criteria bring scipy, which no error in a path should wait for.
            from criteria import CriterionError

            if not isinstance(error, CriterionError):
                raise
            message = str(error)
        except OSError as error:
            message = str(UserError(error.strerror or str(error), where=error.filename))
        click.echo(shortened(f"{self.program}: {message}"), err=True)
        leave(code)


@contextmanager
def _sigterm_like_ctrl_c() -> Iterator[None]:
    """Let SIGTERM interrupt the command, which then leaves its best result so far."""
    main_thread = threading.current_thread() is threading.main_thread()
    # One who starts a program may have it ignore the signal.
    if not main_thread or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def _notes_at_the_end(program: str) -> Iterator[None]:
    """Notes come on standard error, a line each, once the command has succeeded."""
    notes: dict[str, None] = {}
    with warnings.catch_warnings():
        python = warnings.showwarning

        def keep(message: Any, category: type[Warning], *args: Any, **kwargs: Any) -> None:
            if issubclass(category, Note):
                notes[str(message)] = None
            else:
                python(message, category, *args, **kwargs)

        warnings.simplefilter("always", Note)
        warnings.showwarning = keep
        yield
    # A failure has one line, that of the error.
    for text in notes:
        click.echo(shortened(f"{program}: {text}"), err=True)
