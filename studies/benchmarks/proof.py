"""What a bound over every pose costs: boxes and seconds against the gap that is proved.

    python studies/benchmarks/proof.py [PART OF A NAME [CRITERION [GAP [SECONDS]]]]

writes proof.md beside this file. A row is one `edtk.relax(study, criterion, prove=GAP)`: the
relaxation, the search over all poses, the boxes and the certificate together, in a process of its
own, in seconds of processor time. The certificate is then checked by `edtk.verify`. With a part of
a name, only those rows are measured anew; the others, and what is said behind the table, stay as
they are. SECONDS are for a proof, which then has what it reached.
"""

import fcntl
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from measure import Measured, machine, measure

import edtk
import edtk.system.time_limit as limits
from edtk import Study, load_study
from edtk.report.tables import markdown_table

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from fault_robots import robots  # noqa: E402, from the studies

TEN = ("rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5")
SENTENCE = 1e-3  # gap to which the sentence in README is proved
TIME = 120.0  # of processor time for a proof [s], which then has what it reached
LIMIT = 7200.0  # for a row [s]
FIELDS = ("robot", "criterion", "asked gap", "proved gap", "boxes", "seconds", "check")


def kr270(**changes: object) -> Study:
    """The paper's study, with some of its tables changed."""
    study = load_study(HERE.parent / "kr270_milling.toml")
    return study.replace(**changes) if changes else study


def small(kind: str) -> Study:
    """A 3R arm, or a SCARA with its prismatic joint, that holds 5 kg."""
    turning = {"axis": [0, 0, 1], "limits_deg": [-150, 150]}
    if kind == "3R":
        axes = ([0, 0, 1], [0, 1, 0], [0, 1, 0])
        places = ([0, 0, 0.4], [0, 0, 0], [0.5, 0, 0])
        joints = [
            turning | {"name": f"q{j + 1}", "axis": axis, "origin_m": place}
            for j, (axis, place) in enumerate(zip(axes, places, strict=True))
        ]
        force = [20.0, 0.0, -50.0]
    else:
        joints = [
            turning | {"name": f"q{j + 1}", "origin_m": place}
            for j, place in enumerate(([0, 0, 0.4], [0.4, 0, 0], [0.3, 0, 0]))
        ]
        joints.insert(
            2,
            {
                "name": "z",
                "kind": "prismatic",
                "axis": [0, 0, 1],
                "origin_m": [0.3, 0, 0],
                "limits_m": [-0.2, 0.0],
            },
        )
        force = [40.0, 10.0, -50.0]
    return Study(
        title=kind,
        robot={
            "name": kind,
            "source": "made up",
            "joints": joints,
            "tool": {"position_m": [0.3, 0, 0]},
        },
        tool={"position_mm": [300, 0, 0]},
        load={"F_N": force},
        measurement={"sigma_mm": 0.03},
        joints={"unknown": ["q1", "q2", "q3"]},
        workspace={},
    )


def cases() -> dict[str, tuple[Callable[[], Study], tuple[str, ...], tuple[float, ...]]]:
    """Studies, criteria and gaps."""
    beside = partial(kr270, tool={"position_mm": [611.5, 150.0, -460.0]})
    return {
        "KR 270": (kr270, TEN, (1e-2,)),
        "KR 270, fine": (kr270, ("rho0", "A", "D", "E", "G", "O2"), (1e-3,)),
        "KR 270, finest": (kr270, ("rho0", "A", "D", "E"), (1e-6,)),
        "KR 270, tool beside its plane": (beside, ("D",), (1e-2,)),
        "UR10": (partial(of_faults, "UR10, 10 kg"), ("D", "A"), (1e-2,)),
        "UR10, fine": (partial(of_faults, "UR10, 10 kg"), ("rho0",), (1e-2, 1e-3)),
        "3R arm": (partial(small, "3R"), ("D", "A"), (1e-3, 1e-6, 1e-9)),
        "SCARA": (partial(small, "SCARA"), ("D", "A"), (1e-3, 1e-6, 1e-9)),
        "palletiser, three forces": (
            partial(load_study, HERE.parent / "palletiser.toml"),
            ("rho0",),
            (1e-2, 1e-4),
        ),
        "KR 270, seen by a tracker": (tracked, ("rho0",), (1e-1, 3e-2, 1e-2)),
        "KR 270, a tracker that errs across its beam": (
            partial(tracked, along=[2, 1]),
            ("rho0",),
            (1e-1, 3e-2),
        ),
        "KR 270, geometry": (geometry, ("D",), (1e-1, 5e-2)),
        "KR 270, force aside, six free joints": (aside, ("rho0", "D"), (5e-2, 1e-2)),
        "7R arm": (partial(of_faults, "7R arm, 14 kg"), ("D",), (0.3, 0.2, 0.1)),
    }


def tracked(along: Sequence[float] = (10, 5)) -> Study:
    """The paper's study, whose readings err by the distance from a tracker, all ways alike or not.

    Args:
        along: A millionth of a metre, and of a distance, along the beam; across it 10 and 5.
    """
    where = {"tracker_position_mm": [4000, 1000, 1000]}
    return kr270(noise=where | {"along": list(along), "across": [10, 5]})


def geometry() -> Study:
    """All errors of the drawing that positions tell, in poses of six joints."""
    return kr270(
        parameters={"geometry": "all"},
        load=None,
        joints={},
        test_pose=None,
        simulation=None,
        workspace={"height_min_mm": 800, "radius_min_mm": 600},
        optimise=["D"],
        criteria=["D"],
        published=[],
    )


def aside() -> Study:
    """Under a force that is not vertical, which loads joint 1, too: six free joints."""
    names = [f"q{j}" for j in range(1, 7)]
    return kr270(load={"F_N": [1000, 500, -2000]}, joints={"unknown": names}, simulation=None)


def of_faults(name: str) -> Study:
    """A study of another robot, as faults are tried on it."""
    return robots()[name]


def proved(
    make: Callable[[], Study], criterion: str, gap: float, time: float = TIME
) -> tuple[float, int, float, str]:
    """Proved gap, boxes, seconds, and the seconds of the check or why there is none."""
    study = make()
    # The clock is shared with whatever else runs on the machine.
    limits.monotonic = process_time
    with TemporaryDirectory() as folder:
        path = Path(folder) / "certificate.json"
        start = process_time()
        with limits.time_limit(time):
            found = edtk.relax(study, criterion, prove=gap, certificate=path)
        seconds = process_time() - start
        start = process_time()
        claims = {one.claim: one for one in edtk.verify(path).claims}
        claim = claims.get("bound_proved")
        check = "none"
        if claim is not None:
            check = f"{process_time() - start:.0f} s" if claim.holds else claim.reason
    return found.continuum_bound.gap, found.boxes, seconds, check


def row(name: str, criterion: str, gap: float, told: Measured) -> tuple[str, ...]:
    """A row of the table."""
    if told.failure:
        return (name, criterion, f"{gap:.0e}", told.failure, "", "", "")
    reached, boxes, seconds, check = told.answer
    return (name, criterion, f"{gap:.0e}", f"{reached:.1e}", f"{boxes:,}", f"{seconds:.0f}", check)


def sentence() -> str:
    """The bound on the paper's criterion over every pose, with its check."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "certificate.json"
        found = edtk.relax(kr270(), "rho0", prove=SENTENCE, certificate=path)
        verdict = "valid" if edtk.verify(path).valid else "NOT valid"
    told = 1e6 * found.continuum_bound.value
    return (
        f"KR 270, rho0: no plan of m experiments in any poses is below {told:.4f} "
        f"(1e-3 mm)/sqrt(m), by {found.boxes:,} boxes; checked by `edtk verify`: {verdict}."
    )


def asked(words: list[str]) -> Iterator[tuple[str, Callable[[], Study], str, float]]:
    """Names, studies, criteria and gaps of the rows that are to be measured."""
    part, criterion, gap = [*words[:3], "", "", ""][:3]
    for name, (make, criteria, gaps) in cases().items():
        for one in criteria:
            for each in gaps:
                if part in name and criterion in ("", one) and gap in ("", f"{each:.0e}"):
                    yield name, make, one, each


def kept(text: str) -> tuple[str, dict[tuple[str, ...], tuple[str, ...]], str]:
    """The sentence of a page, its rows by what was asked, and what stands behind the table."""
    lines = text.splitlines()
    table = [k for k, line in enumerate(lines) if line.startswith("|")]
    rows = [tuple(cell.strip() for cell in lines[k].split("|")[1:-1]) for k in table[2:]]
    said = next(line for line in lines if line.startswith("KR 270, rho0:"))
    return said, {row[:3]: row for row in rows}, "\n".join(lines[table[-1] + 1 :]).strip()


def write(row: tuple[str, ...] | None, said: str = "") -> None:
    """Put a row, or the sentence, into the page; one process at a time."""
    path = HERE / "proof.md"
    with path.open("r+", encoding="utf-8") as page:
        fcntl.flock(page, fcntl.LOCK_EX)
        old, rows, behind = kept(page.read())
        if row is not None:
            rows[row[:3]] = row
        order = [(robot(name), c, f"{gap:.0e}") for name, _, c, gap in asked([])]
        shown = [rows[one] for one in order if one in rows]
        text = f"""# Bounds over every pose: boxes and seconds against the gap

Written by `python studies/benchmarks/proof.py`, which says what a row is. {machine()}

{said or old}

{markdown_table(FIELDS, shown).rstrip()}

{behind}
"""
        page.seek(0)
        page.truncate()
        page.write(text)


def robot(name: str) -> str:
    """The robot of a case."""
    return re.sub(", fine(st)?$", "", name)


def main() -> None:
    """Measure all rows, or some, and write them into the page."""
    words = sys.argv[1:]
    time = float(words[3]) if len(words) > 3 else TIME
    for name, make, criterion, gap in asked(words):
        told = measure(proved, make, criterion, gap, time, limit=LIMIT)
        found = row(robot(name), criterion, gap, told)
        print(*found, sep=" | ", flush=True)
        write(found)
    if not words:
        write(None, sentence())


if __name__ == "__main__":
    main()
