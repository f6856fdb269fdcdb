"""Pictures of designs for a linear(ised) model: variances, power, aliases, efficiencies, sizes."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.design.bound import printed_form
from edtk.design.exact.comparison import SizeCurve, size_curve
from edtk.design.exact.model_design import TEST_LEVEL, Design, ModelDesign, Places
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.report.draw.bars import name_ticks, short_names
from edtk.report.figures import BLUE, COLOURS, GREY, ORANGE, panels
from edtk.report.shown import plain
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Mask

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FINE = 201  # points of a curve
GRID = 81  # points along each axis of a map
FLAT = 1e-9  # spread of candidates beside the largest, below which they lie in a plane
DISTANT = 10.0  # ratio of two effects beyond which they share a logarithmic axis
WRITTEN = 12  # columns up to which each cell of a map has its number
AREA_OF_MOST = 120.0  # of the marker of the experiment that is made most often [square points]
SAME_DEVIATION = 1e-9  # relative difference of standard deviations that are one
HUNDREDTH = 1e-2  # least of the largest number of a map whose numbers have two decimals
ROUNDED = 1e-9  # part of the largest below which a number is rounding
FULL = 0.999  # power at which the axis of effects ends
BY_NOISE = "variance of prediction /\nvariance of noise"
OF_ONE = "variance of prediction x experiments /\nvariance of noise"


def draw(
    design: Design,
    kind: str,
    own: Mapping[str, Callable[..., None]],
    ax: Any,
    options: Mapping[str, Any],
) -> Any:
    """Draw a design as a kind of picture.

    Args:
        design: A plan or weights.
        kind: Name of the picture: of `own`, or of `KINDS`.
        own: Pictures that this class of designs has besides; a function of the design and axes.
        ax: Axes to draw into; new ones where they are not given.
        options: Further arguments of the picture.

    Returns:
        The axes.

    Raises:
        ArgumentError: There is no such picture, or it does not take these arguments.
    """
    if kind not in own and kind not in KINDS:
        message = f"expected one of {', '.join([*own, *KINDS])}"
        raise ArgumentError(message, argument="kind", given=kind)
    for name in options:
        taken = KINDS[kind].options if kind in KINDS else ("x",)
        if name not in taken:
            words = ", ".join(taken) if taken else "no further arguments"
            raise ArgumentError(f"this picture takes {words}", argument=name)
    axes: Axes = panels(ax, 1, 1, (7.0, 4.0))[0, 0]
    axes.set_title(plain(design.headline()), fontsize=9, wrap=True)
    if kind in own:
        own[kind](design, axes, **options)
    elif kind == "sizes":
        _sizes(design, axes, **options)
    else:
        KINDS[kind].draw(ModelDesign.of(design), axes, **options)
    return axes


def _fds(design: ModelDesign, ax: "Axes") -> None:
    """Variances of predictions at all places in order, over their fraction.

    The variance at a place of rows A is ``trace(A cov A')``, the sum over its rows, in units of the
    noise (Zahran, Anderson-Cook and Myers, Journal of Quality Technology 35, 2003).
    """
    variances = np.sort(design.variances(design.places.rows))
    fraction = (np.arange(len(variances)) + 0.5) / len(variances)
    middle = float(np.median(variances))
    ax.plot(fraction, variances, color=BLUE)
    ax.axhline(middle, linewidth=0.8, linestyle="--", color="0.5")
    ax.annotate(f"median {middle:.3g}, largest {variances[-1]:.3g}", (0.02, middle), va="bottom")
    is_region = not isinstance(design.model, Problem)
    ax.set_xlabel("fraction of the region" if is_region else "fraction of the candidates")
    ax.set_ylabel(_variance_label(design))
    ax.set_xlim(0, 1)
    # Room for the words above the median, where all variances are the same.
    ax.set_ylim(0, 1.1 * float(variances[-1]) or 1.0)


def _variance_label(design: ModelDesign) -> str:
    return OF_ONE if design.size is None else BY_NOISE


def _variance(
    design: ModelDesign,
    ax: "Axes",
    factors: str | Sequence[str] | None = None,
    at: Mapping[str, Any] | None = None,
    x: ArrayLike | None = None,
) -> None:
    """The variance of predictions over one factor or two, with the experiments.

    Args:
        design: The design.
        ax: Where to draw.
        factors: Names of one variable or of two; by default the first two.
        at: Values of others; by default a number is in the middle of its range, and anything else
            has its first value.
        x: Of candidates without a frame: numbers (n,) or (n, 2) to draw over.
    """
    places = _placed(design, x)
    levels = design.model.coded if isinstance(design.model, Problem) and x is None else ()
    names = _factors(places, factors, levels)
    where = [places.names.index(name) for name in names]
    others = _others(design.model, names, at or {})
    needed = design.model.needed if isinstance(design.model, Problem) else None
    plane = None if needed is None or x is not None else _Plane.of(needed, names, tuple(at or {}))
    evaluate = None if x is not None else _evaluation(design, others, names, plane)
    draw_over = _variance_curve if len(names) == 1 else _variance_map
    draw_over(design, places, where, evaluate, ax)
    if evaluate is not None and others:
        moved = [] if plane is None else plane.moved
        held = [f"{plain(str(k))} = {_text(v)}" for k, v in others.items() if k not in moved]
        if moved:
            what = " and ".join(map(plain, moved))
            held.append(f"{what} as the other{'s leave' if len(names) > 1 else ' leaves'} room")
        ax.set_xlabel(f"{ax.get_xlabel()}\nat {', '.join(held)}")


def _placed(design: ModelDesign, x: ArrayLike | None) -> Places:
    """The places, with variables as they were given.

    Raises:
        ArgumentError: They are not one or two numbers for each candidate.
    """
    places = design.places
    if x is None:
        return places
    n = len(places.rows)
    values = np.asarray(x, dtype=float)
    values = values[:, None] if values.ndim == 1 else values
    if design.chosen is None or values.shape not in ((n, 1), (n, 2)):
        message = f"expected one number or two for each of {n} candidates"
        raise ArgumentError(message, argument="x")
    names = ("x",) if values.shape[1] == 1 else ("x1", "x2")
    return Places(places.rows, names, values)


def _factors(
    places: Places, asked: str | Sequence[str] | None, levels: Iterable[str]
) -> tuple[str, ...]:
    """Names of one variable or two, none of which the model knows at its levels alone.

    Raises:
        ArgumentError: There are no such variables.
    """
    known = tuple(name for name in places.names if name not in levels)
    names = known[:2] if asked is None else (asked,) if isinstance(asked, str) else tuple(asked)
    if not 1 <= len(names) <= 2 or any(name not in known for name in names):
        message = f"expected one or two of {', '.join(known)}"
        raise ArgumentError(message, argument="factors", given=asked)
    return names


def _text(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, Real) else plain(str(value))


def _others(
    model: Problem | Region, names: tuple[str, ...], at: Mapping[str, Any]
) -> dict[str, Any]:
    """Values of the variables over which nothing is drawn, as told or by default.

    Raises:
        ArgumentError: There are no such variables.
    """
    if isinstance(model, Problem):
        if model.rows_of is None or model.frame is None:
            if at:
                message = "the model is known at its candidates alone; expected none"
                raise ArgumentError(message, argument="at")
            return {}
        frame = model.frame
        numbers = frame.select_dtypes("number").columns.difference([*model.coded])
        usual: dict[Any, Any] = {
            name: 0.5 * (column.min() + column.max()) if name in numbers else column.iloc[0]
            for name, column in frame.items()
        }
    else:
        usual = dict(zip(model.variables, model.limits.mean(axis=0).tolist(), strict=True))
    unknown = [name for name in at if name not in usual]
    if unknown:
        message = f"expected values of {', '.join(map(str, usual))}"
        raise ArgumentError(message, argument="at", given=unknown[0])
    return {name: value for name, value in (usual | dict(at)).items() if name not in names}


def _evaluation(
    design: ModelDesign,
    others: Mapping[str, Any],
    names: tuple[str, ...],
    plane: "_Plane | None",
) -> Callable[[Array], Array] | None:
    """Variances (k,) at values (k, 1 or 2) of the named variables; nan outside of a region.

    None where the model is known at its candidates alone.
    """
    model = design.model
    if isinstance(model, Problem):
        if model.rows_of is None:
            return None
        assert plane is not None
        return partial(_of_frame, design, model, others, names, plane)
    region = model

    def variances(values: Array) -> Array:
        given = {name: values[:, i] for i, name in enumerate(names)}
        told = given | dict(others)
        columns = [np.broadcast_to(told[name], len(values)) for name in region.variables]
        points = np.stack(columns, axis=-1).astype(float)
        inside = region.at(points).feasible
        found = np.full(len(points), np.nan)
        if inside.any():
            found[inside] = design.variances(region.rows_at(points[inside]))
        return found

    return variances


def _of_frame(
    design: ModelDesign,
    model: Problem,
    others: Mapping[str, Any],
    names: tuple[str, ...],
    plane: "_Plane",
    values: Array,
) -> Array:
    """The same for candidates of a data frame."""
    assert model.rows_of is not None
    assert model.frame is not None
    # The first row brings the type of each column, as of categories.
    table = model.frame.iloc[np.zeros(len(values), dtype=int)].reset_index(drop=True)
    for name, value in others.items():
        table[name] = [value] * len(table)
    for name, column in zip(names, values.T, strict=True):
        table[name] = column
    table, inside = plane.moves(table)
    if not inside.any():
        message = "leave no room where candidates may be; expected other values"
        raise ArgumentError(message, argument="at")
    found = np.full(len(table), np.nan)
    found[inside] = design.variances(model.rows_of(table[inside]))
    return found


@dataclass(frozen=True, eq=False)
class _Plane:
    """Where the variables of candidates may be together: the shares of a mixture have the sum one.

    The variables over which nothing is drawn move the least that leads there.

    Attributes:
        names: Names (d,) of the variables that are numbers.
        moved: Names (h,) of the variables that move; none where the candidates lie in no plane.
        middle: A point (d,) of the plane.
        across: Directions (c, d) in which the candidates do not differ.
        slack: How far (c,) they do by rounding.
        low, high: Ranges (h,) of the variables that move.
    """

    names: list[str]
    moved: list[str]
    middle: Array
    across: Array
    slack: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, frame: "pd.DataFrame", drawn: tuple[str, ...], held: tuple[str, ...]) -> "_Plane":
        """The plane of candidates, over some variables and with others held.

        Raises:
            ArgumentError: There is no room for those over which is drawn.
        """
        numbers = frame.select_dtypes("number").dropna(axis=1)
        x = numbers.to_numpy(dtype=float)
        middle = x.mean(axis=0)
        size = np.abs(x - middle).max(axis=0, initial=0.0)
        unit = np.where(size > 0, size, np.inf)
        _, s, V = np.linalg.svd(np.linalg.qr((x - middle) / unit, mode="r"))
        rank = int((s > FLAT * s.max(initial=0.0)).sum())
        across = V[rank:] / unit
        told = (np.abs(V[rank:]) > FLAT).any(axis=0) & (size > 0)
        free = ~np.isin(numbers.columns, [*drawn, *held]) & told
        # What the free ones cannot make good, the others have to keep among themselves.
        back = across[:, free] @ np.linalg.pinv(across[:, free], FLAT)
        left = (np.eye(len(across)) - back) @ across * size
        if (np.abs(left[:, np.isin(numbers.columns, drawn)]) > FLAT).any():
            words = " and ".join(drawn)
            beside = f" beside {' and '.join(map(str, held))}" if held else ""
            message = f"{words} cannot be chosen freely{beside}, as the candidates lie in a plane"
            raise ArgumentError(message, argument="factors")
        return cls(
            [str(name) for name in numbers],
            [str(name) for name in numbers.columns[free]],
            middle,
            across,
            FLAT + np.abs((x - middle) @ across.T).max(axis=0, initial=0.0),
            (x.min(axis=0) - FLAT * size)[free],
            (x.max(axis=0) + FLAT * size)[free],
        )

    def moves(self, table: "pd.DataFrame") -> tuple["pd.DataFrame", Mask]:
        """Points (k) in the plane, and whether they are there and in the ranges."""
        z = table[self.names].to_numpy(dtype=float, copy=True)
        free = [self.names.index(name) for name in self.moved]
        back = np.linalg.pinv(self.across[:, free], FLAT)
        z[:, free] -= (z - self.middle) @ self.across.T @ back.T
        there = z[:, free]
        inside = np.all((there >= self.low) & (there <= self.high), axis=1)
        inside &= np.all(np.abs((z - self.middle) @ self.across.T) <= self.slack, axis=1)
        return table.assign(**dict(zip(self.moved, there.T, strict=True))), inside


def _variance_curve(
    design: ModelDesign,
    places: Places,
    where: list[int],
    evaluate: Callable[[Array], Array] | None,
    ax: "Axes",
) -> None:
    """Variances over one factor, and a mark below for each experiment."""
    values = places.values[:, where[0]]
    if evaluate is None:
        order = np.argsort(values, kind="stable")
        shown = design.variances(places.rows)[order]
        once = len(np.unique(values)) == len(values)
        ax.plot(values[order], shown, "-" if once else ".", color=BLUE)
    else:
        x = np.linspace(values.min(), values.max(), FINE)
        ax.plot(x, evaluate(x[:, None]), color=BLUE)
    made = _made(design, places)[:, where[0]]
    ax.scatter(made, np.zeros(len(made)), s=_areas(design), color=ORANGE, clip_on=False, zorder=3)
    ax.set_xlabel(f"{plain(places.names[where[0]])} (dots: the experiments, {_area_of(design)})")
    ax.set_ylabel(_variance_label(design))
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)


def _variance_map(
    design: ModelDesign,
    places: Places,
    where: list[int],
    evaluate: Callable[[Array], Array] | None,
    ax: "Axes",
) -> None:
    """Variances over two factors as a map, with a disc for each experiment."""
    values = places.values[:, where]
    if evaluate is None:
        heights = design.variances(places.rows)
        shown: Any = ax.scatter(values[:, 0], values[:, 1], c=heights, s=30, cmap="viridis")
    else:
        axes = [np.linspace(v.min(), v.max(), GRID) for v in values.T]
        grid = np.stack(np.meshgrid(*axes), axis=-1)
        heights = evaluate(grid.reshape(-1, 2)).reshape(GRID, GRID)
        shown = ax.contourf(*axes, heights, levels=12, cmap="viridis")
    made = _made(design, places)[:, where]
    ax.set(xlim=(values[:, 0].min(), values[:, 0].max()))
    ax.set(ylim=(values[:, 1].min(), values[:, 1].max()))
    discs: dict[str, Any] = {"color": "w", "edgecolor": "k", "clip_on": False, "zorder": 3}
    ax.scatter(made[:, 0], made[:, 1], s=_areas(design), **discs)
    first, second = (plain(places.names[i]) for i in where)
    ax.set(xlabel=f"{first} (discs: the experiments, {_area_of(design)})", ylabel=second)
    assert ax.figure is not None
    ax.figure.colorbar(shown, ax=ax, label=_variance_label(design))


def _made(design: ModelDesign, places: Places) -> Array:
    """The variables (k, d) of the experiments that are made."""
    return design.support.values if design.chosen is None else places.values[design.chosen]


def _area_of(design: ModelDesign) -> str:
    return "area by weight" if design.size is None else "area by number"


def _areas(design: ModelDesign) -> Array:
    return np.asarray(AREA_OF_MOST * design.counts / design.counts.max())


def _power(
    design: ModelDesign,
    ax: "Axes",
    parameters: Iterable[str] | None = None,
    level: float = TEST_LEVEL,
    size: int | None = None,
) -> None:
    """Power of the tests that a parameter is zero, over the size that it has.

    Args:
        design: The design.
        ax: Where to draw.
        parameters: Those that are drawn; by default all.
        level: Probability of a false alarm.
        size: Number of experiments that weights stand for.

    Raises:
        ArgumentError: There is no such parameter, or weights have no size.
    """
    if design.size is None and size is None:
        message = "weights stand for a number of experiments; expected it"
        raise ArgumentError(message, argument="size")
    if not 0 < level < 1:
        raise ArgumentError("expected between 0 and 1", argument="level", given=level)
    names = tuple(parameters or design.parameters)
    for name in names:
        if name not in design.parameters:
            message = f"expected some of {', '.join(design.parameters)}"
            raise ArgumentError(message, argument="parameters", given=name)
    chosen = [design.parameters.index(name) for name in names]
    m = 1.0 if design.size is not None or size is None else float(size)
    # Of weights of so many experiments the rows are those of one of each, times the number.
    rows = design.support.rows.shape[1]
    freedom = design.freedom if design.size is not None else max(0, int(m) * rows - design.p)
    deviations = np.sqrt(np.diag(design.covariance)[chosen] / m)
    unit = np.geomspace(0.05, 200, 400)
    curve = design.powers(unit * deviations[0], level, freedom, m)[:, chosen[0]]
    enough = unit[np.searchsorted(curve, FULL).clip(max=len(unit) - 1)]
    is_wide = bool(deviations.max() > DISTANT * deviations.min())
    largest = enough * deviations.max()
    effects = (
        np.geomspace(0.05 * deviations.min(), largest, FINE)
        if is_wide
        else np.linspace(0, largest, FINE)
    )
    powers = design.powers(effects, level, freedom, m)[:, chosen]
    short = [plain(name) for name in short_names(names)]
    for i, alike in enumerate(_alike(deviations)):
        style = ("-", "--", ":", "-.")[i // len(COLOURS) % 4]
        lines = ax.plot(effects, powers[:, alike], style, color=COLOURS[i % len(COLOURS)])
        lines[0].set_label("\n".join(short[j] for j in alike))
    if is_wide:
        ax.set_xscale("log")
    noise = f"{freedom} degrees of freedom for the noise" if freedom else "the noise is known"
    ax.set_xlabel(f"size of the parameter [its unit]; {noise}")
    ax.set_ylabel(f"power of a test at level {level:g}")
    ax.set_ylim(0, 1.02)
    ax.grid(alpha=0.3)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)


def _alike(deviations: Array) -> list[list[int]]:
    """Numbers of parameters with the same standard deviation: their curves are one."""
    found: list[list[int]] = []
    for i, deviation in enumerate(deviations.tolist()):
        same = [g for g in found if abs(deviations[g[0]] - deviation) <= SAME_DEVIATION * deviation]
        if same:
            same[0].append(i)
        else:
            found.append([i])
    return found


def _correlation(design: ModelDesign, ax: "Axes", beyond: Any = None) -> None:
    """Sizes of the correlations of all columns of the model, and of terms beyond it."""
    names, found = design.correlations(beyond)
    label = "size of the correlation between columns"
    _cells(np.abs(found), names, names, label, "Blues", (0.0, 1.0), ax)
    own = sum(name in design.parameters for name in names)
    if own < len(names):
        for line in (ax.axhline, ax.axvline):
            line(own - 0.5, color=ORANGE, linewidth=1.2)
        ax.set_xlabel("beyond the lines: terms that the model leaves out")


def _alias(design: ModelDesign, ax: "Axes", beyond: Any = None) -> None:
    """What each estimate is off by, for each unit of a term that the model leaves out.

    Raises:
        ArgumentError: There is no such term.
    """
    names, bias = design.aliases(beyond)
    if not names:
        message = "the model leaves out no product of two variables; expected what it leaves out"
        raise ArgumentError(message, argument="beyond")
    largest = float(np.abs(bias).max()) or 1.0
    label = "bias of the estimate / coefficient of the term"
    _cells(bias, design.parameters, names, label, "RdBu_r", (-largest, largest), ax)


def _cells(
    values: Array,
    rows: Sequence[str],
    columns: Sequence[str],
    label: str,
    colours: str,
    limits: tuple[float, float],
    ax: "Axes",
) -> None:
    """A matrix in colours, with its numbers where they are few."""
    image = ax.imshow(values, cmap=colours, vmin=limits[0], vmax=limits[1], aspect="auto")
    if max(values.shape) <= WRITTEN:
        for place, value in enumerate(values.ravel().tolist()):
            i, j = divmod(place, values.shape[1])
            is_dark = abs(value) > 0.6 * limits[1]
            colour = "white" if is_dark else "#111111"
            ax.text(
                j, i, _number(value, limits[1]), ha="center", va="center", fontsize=8, color=colour
            )
    name_ticks(ax, columns, rows)
    assert ax.figure is not None
    ax.figure.colorbar(image, ax=ax, label=label)


def _number(value: float, largest: float) -> str:
    """A number among others: two decimals, or three digits where two decimals do not suit them."""
    if HUNDREDTH <= largest < 1 / HUNDREDTH:
        return f"{value + 0.0:.2f}".replace("-0.00", "0.00")
    return f"{value:.3g}" if abs(value) > ROUNDED * largest else "0"


def _efficiencies(design: ModelDesign, ax: "Axes", criteria: Sequence[Any] | None = None) -> None:
    """Efficiencies against the bound of each criterion as bars, with their numbers.

    Raises:
        UserError: Bounds are of independent errors, and those of the design are not.
    """
    if design.arranged is not None:
        raise UserError(
            "a structure of errors has a bound of the plan's own criterion alone; edtk.compare "
            "puts such plans side by side"
        )
    asked = design.other_criteria(criteria)
    values = 100 * np.array([design.efficiency(one) for one in asked.values()])
    at = np.arange(len(values))
    own = design.criterion.label
    ax.barh(at, values, color=[BLUE if name == own else GREY for name in asked], height=0.6)
    for place, value in enumerate(values.tolist()):
        ax.text(value + 1, place, f"{value:.1f}", va="center", fontsize=9)
    ax.set_yticks(at, [plain(name) for name in asked])
    ax.set_ylim(len(at) - 0.5, -0.5)
    ax.set_xlim(0, 112)
    ax.set_xlabel("efficiency [% of the bound of the criterion]")
    ax.grid(axis="x", alpha=0.3)
    ax.set_axisbelow(True)


def _sizes(design: Design, ax: "Axes", sizes: Iterable[int] | None = None) -> None:
    """The criterion over the number of experiments: plans, and the bound of each size."""
    found = size_curve(design, sizes)
    sense = found.criterion.sense
    ax.plot(found.sizes, printed_form(found.bounds, sense), ".-", color=GREY, label="bound")
    values = printed_form(found.costs, sense)
    ax.plot(found.sizes, values, "o-", color=BLUE, label="best plan found")
    if found.own is not None:
        size, cost = found.own
        ax.plot(size, printed_form(cost, sense), "D", color=ORANGE, label="this plan", zorder=3)
    ax.set_xlabel(f"experiments{_gain(found)}")
    ax.set_ylabel(f"{plain(found.criterion.label)}: {plain(found.criterion.formula)}")
    if sense == "min" and found.costs.max() > DISTANT * found.costs.min():
        ax.set_yscale("log")
    ax.locator_params(axis="x", integer=True)
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, fontsize=9)


def _gain(found: SizeCurve) -> str:
    """What one more experiment brings, in words; nothing where it was not looked for."""
    sizes = found.sizes.tolist()
    if found.own is None or found.own[0] + 1 not in sizes:
        return ""
    size, cost = found.own
    sense = found.criterion.sense
    more = printed_form(float(found.costs[sizes.index(size + 1)]), sense)
    change = more / printed_form(cost, sense) - 1
    return f"; one more than {size}: {plain(found.criterion.label)} {change:+.1%}"


@dataclass(frozen=True)
class Kind:
    """A picture that designs of all kinds have.

    Attributes:
        draw: Draws it.
        options: Its further arguments.
    """

    draw: Callable[..., None]
    options: tuple[str, ...] = ()


KINDS = {
    "fds": Kind(_fds),
    "variance": Kind(_variance, ("factors", "at", "x")),
    "power": Kind(_power, ("parameters", "level", "size")),
    "correlation": Kind(_correlation, ("beyond",)),
    "alias": Kind(_alias, ("beyond",)),
    "efficiencies": Kind(_efficiencies, ("criteria",)),
    "sizes": Kind(_sizes, ("sizes",)),
}
