"""Results show themselves: in a line, as text, in a notebook."""

import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from edtk.system.presented import LINE, Presented


@dataclass(frozen=True, eq=False)
class Made(Presented):
    """A result without any file in edtk.report."""

    values: np.ndarray

    def headline(self) -> str:
        """Two lines, which the representation joins."""
        return f"{len(self.values)} values\nin all & <more>"


@dataclass(frozen=True, eq=False)
class Remade(Made):
    """A result of a derived class."""


class Named(Made):
    """A result with a representation of its own."""

    def __repr__(self) -> str:
        return "named"


class NamedToo(Named):
    """A result that inherits one."""


def test_a_repr_is_one_line() -> None:
    """A dataclass that inherits from Presented is represented by its headline, on a single line."""
    assert repr(Made(np.zeros(1000))) == "<Made: 1000 values in all & <more>>"
    assert repr(Remade(np.zeros(2))) == "<Remade: 2 values in all & <more>>"
    assert repr(NamedToo(np.zeros(2))) == "named"


def test_a_long_headline_is_cut() -> None:
    """A headline longer than a line of a terminal loses its end."""

    class Long(Presented):
        def headline(self) -> str:
            return "word " * 100

    assert len(repr(Long())) == LINE
    assert repr(Long()).endswith("...>")


def test_without_files_of_its_own_a_result_is_rendered_like_any() -> None:
    """The headline serves as text and, escaped, in a notebook; a picture is refused."""
    result = Made(np.zeros(3))
    assert result.summary() == result.headline()
    assert "&amp; &lt;more&gt;" in result._repr_html_()
    with pytest.raises(TypeError, match="a Made has no picture"):
        result.plot()


def test_a_repr_needs_no_report() -> None:
    """Neither the class nor its representation imports edtk.report, pandas or matplotlib."""
    code = (
        "import sys\n"
        "from edtk.system.presented import Presented\n"
        "repr(Presented())\n"
        "print([name for name in ('edtk.report', 'pandas', 'matplotlib') if name in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (answer.stdout, answer.stderr) == ("[]\n", "")
