"""Options and helpers that commands share, and errors in one line."""

import math
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from textwrap import wrap
from threading import Timer
from time import monotonic, time
from typing import TYPE_CHECKING, Any, NoReturn

import click

from edtk.system.errors import (
    LONGEST,
    PROGRAM,
    WHERE,
    ArgumentError,
    Note,
    UserError,
    shortened,
)
from edtk.system.files import STANDARD_OUTPUT, is_standard_output, write_files
from edtk.system.interruptible import leave
from edtk.system.parsing import json_text

if TYPE_CHECKING:
    from edtk.findings.finding import Finding
    from edtk.verbs.bayes import Sampling

USER_ERROR = 2  # exit code
INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it
FLAGS = {"memory_mb": "--memory", "second": "--for"}  # of arguments whose flags have other names
# Options that help where the library raises an error of this class: only commands know a flag.
HINTS = {
    "InputError": "; --as-is takes it as it is",
    "UnconvergedError": " with --most, or expect less with --accuracy",
    "SigmaTooSmallError": ", or --sigma-unknown",
}
NO_ROOM = "failed to map segment"  # of a library that does not fit into the memory that is left
SHOWN_AFTER_S = 1.0
MOST_LINES = 4  # of a finding
PARTIAL = 1  # exit code: there is an answer, but not to everything that was asked


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
        except (MemoryError, ImportError) as error:
            if isinstance(error, ImportError) and NO_ROOM not in str(error):
                raise
            message = f"out of memory: {error}".rstrip(": ")
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


@contextmanager
def progress_line(first: str) -> Iterator[Callable[[str], None]]:
    """A line on standard error that says the current step and the time since the beginning.

    It appears after a second, so that short work and refused input show none. Where standard error
    is no terminal, such as a file, the steps of a long work are few lines: each after twice the
    time of the one before.

    Args:
        first: The first step, which may take long.

    Yields:
        What to call with each next step.
    """
    if not sys.stderr.isatty():
        lines = FewLines()
        timer = Timer(SHOWN_AFTER_S, lines.tell, [first])
        timer.daemon = True
        timer.start()
        try:
            yield lines.say
        finally:
            timer.cancel()
        return
    from tqdm import tqdm

    bar = tqdm(
        desc=first,
        file=sys.stderr,
        bar_format="{desc} [{elapsed}]",
        delay=SHOWN_AFTER_S,
        mininterval=0,
        miniters=1,
    )

    def appear() -> None:
        bar.last_print_t = time()  # else its end would take the line for one never shown
        bar.refresh()

    # A bar looks at the clock when there is news only, of which the first step has none.
    timer = Timer(SHOWN_AFTER_S, appear)
    timer.daemon = True
    timer.start()
    try:
        with bar:

            def say(step: str) -> None:
                bar.set_description_str(step, refresh=False)
                bar.update()

            yield say
    finally:
        timer.cancel()


class FewLines:
    """Lines on standard error, the first after a while, and fewer and fewer."""

    def __init__(self) -> None:
        self._since = monotonic()
        self._next = SHOWN_AFTER_S

    def say(self, step: str) -> None:
        """Print a step, if it is time for one."""
        passed = monotonic() - self._since
        if passed < self._next:
            return
        self._next = 2 * passed
        self.tell(step)

    def tell(self, step: str) -> None:
        """Print a step in any case; the next line comes no later for it."""
        minutes, seconds = divmod(int(monotonic() - self._since), 60)
        click.echo(f"{step} [{minutes:02d}:{seconds:02d}]", err=True)


class NamedPath(click.Path):
    """A path that is not empty: an empty one would mean the present folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert to a path.

        Raises:
            click.BadParameter: The value is empty, or no path of this kind.
        """
        if not str(value):
            self.fail("the path is empty.", param, ctx)
        return super().convert(value, param, ctx)


FilePath = NamedPath(path_type=Path, dir_okay=False)
FolderPath = NamedPath(path_type=Path, file_okay=False)


class Range(click.FloatRange):
    """A range of numbers that rejects NaN."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert to a number in the range.

        Raises:
            click.BadParameter: The value is not in the range.
        """
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not in the range {self._describe_range()}.", param, ctx)
        return number


class Whole(click.IntRange):
    """A range of whole numbers."""

    name = "integer"


class Number(Whole):
    """A whole number from 1 on, whose limit is written with few digits."""

    def __init__(self, most: int) -> None:
        super().__init__(min=1, max=most)

    def _describe_range(self) -> str:
        return f"1<=x<={self.max:g}"


Command = Callable[..., None]


def budget_option(words: str) -> Callable[[Command], Command]:
    """The option --budget, of which a command has the end: `time_until` is what is left of it."""
    return click.option("--budget", type=Range(min=0, min_open=True), callback=_end_of, help=words)


def _end_of(context: click.Context, option: click.Parameter, seconds: float | None) -> float | None:
    """When a budget ends that begins now, on the clock of `monotonic` [s]; None without one."""
    return None if seconds is None else monotonic() + seconds


def time_until(end: float | None) -> float | None:
    """What is left of a budget [s], zero after its end; what is read and loaded before counts."""
    return None if end is None else max(0.0, end - monotonic())


json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
seed_option = click.option("--seed", type=Whole(min=0), help="Seed [default: the study's].")
criterion_option = click.option(
    "--criterion",
    help="Criterion to optimise [default: rho0 if the study optimises it, else its first].",
)
certificate_option = click.option(
    "--certificate", type=FilePath, help="Write what proves the numbers (JSON), for edtk verify."
)
workers_option = click.option(
    "--workers",
    type=Whole(min=1),
    help="Processes on this machine [default: one a core].",
)
dask_option = click.option(
    "--dask", metavar="ADDRESS", help="Use the workers of a Dask cluster, tcp://HOST:PORT."
)


def show(result: Any, as_json: bool, *outputs: Path | None) -> None:
    """Print a result on standard output: its text, or its JSON.

    Where a file was written to standard output, the result goes to standard error: a program that
    reads the one should not meet the other.
    """
    text = json_text(result.to_dict()) if as_json else result.summary()
    if any(map(is_standard_output, outputs)):
        click.echo(text, err=True)
    else:
        print_out(text)


def print_out(text: str) -> None:
    """Print on standard output.

    Raises:
        OSError: Standard output cannot be written; the error names it.
    """
    write_files({STANDARD_OUTPUT: text if text.endswith("\n") else f"{text}\n"})


def warn(message: str, where: Path | None = None) -> None:
    """Print one line on standard error, as an error would say it of that file."""
    click.echo(f"edtk: {UserError(message, where=where)}", err=True)


def warn_in_full(message: str, where: Path) -> None:
    """Print a sentence about a file on standard error, on as many lines as it takes.

    An error may repeat anything that a file holds, and is cut; a finding has words of its own.
    """
    width = LONGEST - PROGRAM - min(len(f"{where}: "), WHERE)
    first, *more = wrap(shortened(message, MOST_LINES * width), width, break_on_hyphens=False)
    warn(first, where)
    for line in more:
        click.echo(f"edtk:   {line}", err=True)


def warn_about(where: Path, findings: Iterable["Finding"]) -> None:
    """Print each finding about a file on standard error."""
    for one in findings:
        warn_in_full(str(one), where)


def end_interrupted() -> NoReturn:
    """End with the exit code of an interrupted program."""
    leave(INTERRUPTED)


def end_partial() -> NoReturn:
    """End with the exit code of an answer that leaves something out."""
    leave(PARTIAL)


_OPTIONS = (
    click.option(
        "--accuracy",
        type=Range(min=1e-4, max=0.5),
        help="Monte-Carlo error of standard deviations, relative.  [default: 0.01]",
    ),
    click.option("--most", type=Whole(min=1), help="Limit on steps.  [default: 60000]"),
    click.option(
        "--chain", type=FilePath, help="Keep the chain (HDF5), and go on from a kept one."
    ),
    click.option("--export", type=FilePath, help="Write ArviZ InferenceData (NetCDF)."),
    seed_option,
)


@dataclass(frozen=True)
class SamplingOptions:
    """The options as they are given on the command line; None where one is not given."""

    accuracy: float | None
    most: int | None
    chain: Path | None
    export: Path | None
    seed: int | None

    def given(self) -> list[str]:
        """Names of the options that are given."""
        return [f"--{name}" for name, value in vars(self).items() if value is not None]

    @contextmanager
    def with_progress(self) -> "Iterator[Sampling]":
        """How to sample, with a progress bar on standard error for long runs."""
        from tqdm import tqdm

        from edtk.verbs.bayes import Sampling

        with tqdm(
            unit="step", file=sys.stderr, desc="emcee", delay=SHOWN_AFTER_S, leave=False
        ) as bar:
            yield Sampling(**vars(self), progress=lambda steps: bar.update(steps - bar.n))


def sampling_options(command: Command) -> Command:
    """Add the options to a command, which takes them as one argument `sampling`."""

    @wraps(command)
    def bundled(
        *args: object,
        accuracy: float | None,
        most: int | None,
        chain: Path | None,
        export: Path | None,
        seed: int | None,
        **others: object,
    ) -> None:
        options = SamplingOptions(accuracy, most, chain, export, seed)
        command(*args, sampling=options, **others)

    for option in reversed(_OPTIONS):
        bundled = option(bundled)
    return bundled
