"""The mixin by which a result shows itself: in one line, as text, in a notebook, as a picture."""

from importlib import import_module
from typing import Any

LINE = 100  # characters that fit on a line of a terminal


class Presented:
    """A result that a person can look at.

    A class that inherits from it says `headline()`, and nothing else. The room `edtk.report`
    renders results, with one page for each family of them: `report/views/plan.py` holds the
    function `exact_plan_text(result)` that writes the `summary()` of an `ExactPlan`, and those of
    the other forms. Where a table says it all, `plan_rows(result)` has its header and rows, and
    `plan_notes(result)` perhaps the lines above it; text and notebook are made of them. So no other
    function of a page may have such a name. A class without any of these is rendered like its base
    class, at last like any `Presented`.

    `edtk.report` lies above all rooms that hold results, and some of it needs matplotlib. So it is
    looked up when it is called, and never imported with the class.
    """

    __slots__ = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # A dataclass writes a __repr__ of its own, screens long where a field is an array, unless
        # the class itself has one: an inherited one does not count.
        cls.__repr__ = cls.__repr__  # type: ignore[method-assign]

    def headline(self) -> str:
        """The result in one line, with its main numbers."""
        return type(self).__name__

    def __repr__(self) -> str:
        text = " ".join(f"<{type(self).__name__}: {self.headline()}>".split())
        return text if len(text) <= LINE else f"{text[: LINE - 4]}...>"

    def summary(self) -> str:
        """Text for a terminal, of several lines."""
        return str(_rendered("text", self))

    def _repr_html_(self) -> str:
        """A small table for a notebook, without outside links."""
        return str(_rendered("notebook", self))

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the result with matplotlib.

        Args:
            ax: Axes to draw into; a new figure where it is not given. A picture of several panels
                divides the place of these axes.
            options: Further arguments of the picture, such as the joint variables q of a robot; see
                the function of the class in `edtk.report.views`.

        Returns:
            The axes, or an array of them where the picture has several panels.

        Raises:
            TypeError: Such a result has no picture.
        """
        return _rendered("plot", self, ax, **options)

    def show(self, *arguments: Any, **options: Any) -> Any:
        """Make a page with pictures of each pose, which shows itself in a notebook.

        Args:
            arguments: What the result does not know by itself: a plan alone needs its study.
            options: Further arguments, such as the joint variables q of a robot; see the function
                of the class in `edtk.report.views`.

        Returns:
            The page, whose `.html` is a file's text.

        Raises:
            TypeError: Such a result has no poses.
        """
        return _rendered("show", self, *arguments, **options)


def _rendered(form: str, result: Presented, *arguments: Any, **options: Any) -> Any:
    """The result in a form: "text", "notebook" or "plot"."""
    return import_module("edtk.report.render").render(form, result, *arguments, **options)
