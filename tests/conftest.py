"""Fixtures that more than one suite needs."""

import gc
import subprocess
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from criteria import registry
from criteria.linalg.long_product import IS_LONGER
from edtk.design.relaxation.relax_poses import ROUNDS
from edtk.fit.run_chain import Demand
from edtk.report.page import PX, svg
from edtk.system.workers import open_workers

Array = NDArray[np.float64]

PLUGIN_MODULE = '''
"""A criterion of somebody else's."""

import numpy as np

from criteria import Criterion


class TraceM(Criterion):
    """The trace of the information matrix, to be maximised."""

    name = "trace_M"
    title = "Trace of the information"
    formula = "trace(M)"
    sense = "max"
    degree = 1.0
    convex = True

    def _cost(self, M, cov):
        return 1.0 / np.trace(M, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return -(self._cost(M, cov)[..., None, None] ** 2) * np.eye(M.shape[-1])
'''

PLUGIN_PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "my-criterion"
version = "1.0"

[project.entry-points."edtk.criteria"]
trace_M = "my_criterion:TraceM"

[tool.hatch.build.targets.wheel]
include = ["my_criterion.py"]
"""


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option of `make quick`."""
    parser.addoption(
        "--first-case", action="store_true", help="of a test with several cases run the first"
    )


@pytest.hookimpl(tryfirst=True)
def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """With --first-case make no other cases of a test, which would take as long as running one."""
    if metafunc.config.getoption("--first-case"):
        metafunc.parametrize = partial(_first_case, metafunc.parametrize)  # type: ignore[method-assign]


def _first_case(
    parametrize: Callable[..., None], names: object, values: Iterable[object], **options: Any
) -> None:
    """Call `parametrize` with the first value that is not left out by its marks."""
    listed = list(values)
    quick = (i for i, one in enumerate(listed) if not _is_slow(one))
    first = next(quick, 0)
    ids = options.get("ids")
    if isinstance(ids, Iterable):
        options["ids"] = list(ids)[first : first + 1]
    parametrize(names, listed[first : first + 1], **options)


def _is_slow(value: object) -> bool:
    """Whether a value of a test is marked as one that `make quick` leaves out."""
    return any(mark.name in ("slow", "zoo") for mark in getattr(value, "marks", ()))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what this machine has not."""
    missing = {"unix": sys.platform == "win32", "long_doubles": not IS_LONGER}
    for item in items:
        for name in (name for name, is_missing in missing.items() if is_missing):
            if item.get_closest_marker(name):
                item.add_marker(pytest.mark.skip(reason=f"this machine has no {name}"))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage while tests are collected: a third of that time, and there is none."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish() -> None:
    """Spare the garbage collector what was imported, which it would look through time and again.

    Programs of cvxpy are made of so many objects that this takes a tenth of all tests' time.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 50)


@pytest.fixture(scope="session", autouse=True)
def one_process() -> Iterator[None]:
    """Verbs that are told no number of workers do the work in this process: starting others takes
    seconds, and the answers do not depend on their number, as tests that name a number show.
    """

    def here(workers: int | None, dask: str | None) -> object:
        return open_workers(workers or 1, dask)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.verbs.inputs.open_workers", here)
        yield


@dataclass(frozen=True)
class ShortChain(Demand):
    """What verbs and commands demand of a chain that nobody takes for more than a test's."""

    length: float = 15.0


def undrawn(figure: Any) -> tuple[str, float]:
    """A picture of a page without its drawing, which takes a fifth of a second."""
    return "<svg></svg>", PX * figure.get_figwidth()


@pytest.fixture
def undrawn_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without their pictures, in a module that has them drawn otherwise."""
    monkeypatch.setattr("edtk.report.page.svg", undrawn)


@pytest.fixture(scope="module")
def drawn_pages() -> Iterator[None]:
    """Pages with their pictures drawn, as users have them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.report.page.svg", svg)
        yield


SMALL: dict[str, object] = {
    # Searches over all poses, those of `verify` too, look at fewer poses from fewer starts, and
    # those for a bound are two.
    "edtk.design.relaxation.search_continuum.SCREEN": 2000,
    "edtk.design.relaxation.search_continuum.STARTS": 12,
    "edtk.design.relaxation.relax_poses.ROUNDS": 2,
    "edtk.calibration.evaluate_geometry.SEARCHES": 2,
    "edtk.certificate.proof.OWN_DRAWS": 256,
    "edtk.certificate.proof.STARTS": 4,
    # Searches for a plan end after one batch of starts, few of which are refined, and none kicked.
    "edtk.study.plan_study.STARTS": 16,
    "edtk.design.exact.find_plan.ELITE": 2,
    "edtk.design.exact.search_record.KICK_TURNS": 0,
    "edtk.design.exact.visit_search.ELITE_VISITS": 1,
    "edtk.design.exact.visit_search.VISIT_ROUNDS": 1,
    "edtk.calibration.evaluate_geometry.VISIT_STARTS": 3,
    # Among listed candidates they take a tenth of the effort, and in regions fewer starts.
    "edtk.design.exact.counts.counts_search.EFFORT": 1e9,
    "edtk.design.exact.plan_region.REGION_PLAN_STARTS": 8,
    "edtk.design.exact.plan_region.GRID": 150,
    # Of ranges of theta fewer are tried.
    "edtk.design.theta_box.THETA_TRIED": 64,
    "edtk.design.theta_box.SEARCHES": 3,
    # Chains of verbs and commands end after fifteen autocorrelation times.
    "edtk.fit.run_chain.Demand": ShortChain,
    # Pages have no drawings, see `drawn_pages`.
    "edtk.report.page.svg": undrawn,
}


# For modules that ask how a plan is found, judged and written, and not how good it is.
SHORTEST: dict[str, object] = {
    "edtk.design.relaxation.search_continuum.SCREEN": 1000,
    "edtk.design.relaxation.search_continuum.STARTS": 6,
    "edtk.design.relaxation.relax_poses.ROUNDS": 1,
    "edtk.design.exact.find_plan.ELITE": 1,
}


@pytest.fixture(scope="session", autouse=True)
def small_searches() -> Iterator[pytest.MonkeyPatch]:
    """Searches and chains as `SMALL` has them.

    What is found is judged as anything else; tests of the searches and of chains themselves choose
    their own numbers, see `sharp_bounds` and `whole_searches`.
    """
    with pytest.MonkeyPatch.context() as patch:
        _make_searches_small(patch)
        yield patch


def _make_searches_small(patch: pytest.MonkeyPatch, numbers: Mapping[str, object] = SMALL) -> None:
    for name, few in numbers.items():
        patch.setattr(name, few)


@pytest.fixture(scope="module")
def shortest_searches() -> Iterator[None]:
    """Searches over all poses and for plans as `SHORTEST` has them."""
    with pytest.MonkeyPatch.context() as patch:
        _make_searches_small(patch, SHORTEST)
        yield


@pytest.fixture(scope="module")
def sharp_bounds() -> Iterator[None]:
    """As many searches for a bound as users have, for a module that tells how sharp bounds are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edtk.design.relaxation.relax_poses.ROUNDS", ROUNDS)
        yield


@pytest.fixture(scope="module")
def whole_searches(small_searches: pytest.MonkeyPatch) -> Iterator[None]:
    """The searches that users have, for a module whose answers are compared with those of other
    processes.
    """
    small_searches.undo()
    yield
    _make_searches_small(small_searches)


@pytest.fixture(scope="session")
def plugin_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory for PYTHONPATH into which a third party's criterion `trace_M` was installed by
    pip.
    """
    folder = tmp_path_factory.mktemp("plugin")
    source = folder / "dist"
    site = folder / "site"
    source.mkdir()
    (source / "my_criterion.py").write_text(PLUGIN_MODULE)
    (source / "pyproject.toml").write_text(PLUGIN_PROJECT)
    options = [
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--disable-pip-version-check",
        "--quiet",
    ]
    command = [sys.executable, "-m", "pip", "install", *options, "--target", str(site), str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return site


@pytest.fixture
def plug_in(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    """A function that installs a directory of third parties' criteria, for one test."""
    registry.available()  # loads the built-ins, once for all tests
    monkeypatch.setattr("criteria.registry._registered", registry._registered.copy())
    return lambda site: monkeypatch.syspath_prepend(str(site))


@pytest.fixture(scope="session")
def derivative() -> Callable[..., Array]:
    """Central difference of fourth order of a function along every coordinate, appended as the last
    axis.

    With h = 1e-3 truncation is h^4/30 of the fifth derivative and rounding eps/h of the value:
    about 1e-12 of a function whose derivatives are of order one.
    """

    def along(f: Callable[[Array], Array], x: Array, h: float = 1e-3) -> Array:
        columns = []
        for e in h * np.eye(len(x)):
            inner = f(x + e) - f(x - e)
            outer = f(x + 2 * e) - f(x - 2 * e)
            columns.append((8 * inner - outer) / (12 * h))
        return np.stack(columns, axis=-1)

    return along
