"""Programs of all brands: what is written is read again by readers that share nothing with it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from program_readers import READERS

from edtk.programs import writer
from edtk.programs.program import (
    Axis,
    Comment,
    Dwell,
    Move,
    Program,
    ProgramError,
    Step,
    Wait,
    axes_of,
)

SIGNALS = {
    "krl": ("12", "7"),
    "rapid": ("do_ready", "di_done"),
    "urscript": ("1", "0"),
    "fanuc_ls": ("3", "4"),
    "csv": ("ready", "done"),
}
PLACES = {"krl": "A{}", "rapid": "{}", "urscript": "{}", "fanuc_ls": "J{}"}
ARM = axes_of([f"q{i}" for i in range(1, 7)], ["revolute"] * 6)
RAIL = axes_of(["rail", *(f"q{i}" for i in range(1, 7))], ["prismatic"] + ["revolute"] * 6)


def random_program(rng: np.random.Generator, brand: str, axes: tuple[Axis, ...]) -> Program:
    """Poses, repeated or not, with all that may be between them."""
    made = writer.get(brand)
    low, high = np.array([(0, 9e3) if axis.external else (-350, 350) for axis in axes]).T
    home = tuple(made.taken(rng.uniform(low, high), axes).tolist())
    steps: list[Step] = [Move(home, purpose="home")]
    row = 1
    for _ in range(rng.integers(1, 30)):
        pose = made.taken(rng.uniform(low, high), axes)
        for _ in range(rng.integers(0, 3)):
            via = made.taken(rng.uniform(low, high), axes)
            steps.append(Move(tuple(via.tolist()), purpose="via"))
        for _ in range(rng.integers(1, 4)):
            last = row + int(rng.integers(0, 4))
            steps.append(Move(tuple(pose.tolist()), (row, last)))
            row = last + 1
            if rng.random() < 0.7:
                steps.append(Dwell(round(rng.uniform(0, 300), 2)))
            signals = SIGNALS[brand] if rng.random() < 0.5 else None
            steps.append(Wait('read, and write it down: \u00e4 "quoted" back\\slash ' * 3, signals))
        if rng.random() < 0.3:
            steps.append(Comment("a remark that is longer than any of the brands would take " * 4))
    steps.append(Move(home, purpose="home"))
    return Program(f"plan_{rng.integers(1e6)}", axes, tuple(steps), 25, ("what it is",) * 2)


def expected(program: Program, brand: str) -> list[tuple[object, ...]]:
    """The same as readers return it."""
    found: list[tuple[object, ...]] = []
    for step in program.steps:
        match step:
            case Move(target, rows):
                found += [("rows", *rows)] if rows else []
                found.append(("move", by_place(program.axes, target, brand)))
            case Dwell(seconds):
                found.append(("dwell", seconds))
            case Wait(_, signals):
                found.append(("ask", *signals) if signals else ("stop",))
    return found


def by_place(axes: tuple[Axis, ...], target: tuple[float, ...], brand: str) -> dict[str, float]:
    """Values under the names that the brand has for axes."""
    units = {"revolute": "deg", "prismatic": "mm"}
    if brand == "csv":
        return {f"{a.joint}_{units[a.kind]}": x for a, x in zip(axes, target, strict=True)}
    name = PLACES[brand]
    pairs = zip(axes, target, strict=True)
    return {axis.place if axis.external else name.format(axis.number): x for axis, x in pairs}


@pytest.mark.parametrize("brand", sorted(READERS))
def test_random_programs_are_read_back_to_the_printed_digit(brand: str) -> None:
    """Of 50 programs each step comes back, and each angle is the one that was to be shown."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        on_rail = seed % 2 == 1 and brand != "urscript"
        program = random_program(rng, brand, RAIL if on_rail else ARM)
        name, steps = READERS[brand](dict(writer.get(brand).files(program)))
        assert name.lower() == ("" if brand == "csv" else program.name)
        whole = expected(program, brand)
        assert [step[0] for step in steps] == [step[0] for step in whole]
        for got, wanted in zip(steps, whole, strict=True):
            if got[0] != "move":
                assert got == wanted
                continue
            values = wanted[1]
            assert set(got[1]) == set(values)
            for axis, value in got[1].items():
                # In radians the last digit written is below the last one of a degree's three.
                assert abs(value - values[axis]) < (1e-9 if brand == "urscript" else 1e-12)
                assert round(value, 3) == round(values[axis], 3)


@pytest.mark.parametrize("brand", sorted(READERS))
def test_what_is_taken_is_near_and_stays(brand: str) -> None:
    """A controller takes the nearest value, and what it takes is taken again as it is."""
    shown = np.random.default_rng(1).uniform(-350, 350, (1000, 6))
    made = writer.get(brand)
    taken = made.taken(shown, ARM)
    assert np.abs(taken - shown).max() <= 0.5e-3 + 1e-6
    np.testing.assert_array_equal(made.taken(taken, ARM).round(9), taken.round(9))


def test_a_rail_is_an_axis_beside_the_robot() -> None:
    """Sliding joints under an arm are E1, E2; those of a gantry, or of a SCARA, are the robot's."""
    assert [axis.place for axis in RAIL] == ["E1", "1", "2", "3", "4", "5", "6"]
    gantry = axes_of("xyzabc", [*["prismatic"] * 3, *["revolute"] * 3])
    assert [axis.place for axis in gantry] == ["1", "2", "3", "4", "5", "6"]
    scara = axes_of("abzc", ["revolute", "revolute", "prismatic", "revolute"])
    assert [axis.place for axis in scara] == ["1", "2", "3", "4"]
    palletiser = axes_of("abcd", ["revolute"] * 4, "1,2,3,6")
    assert [axis.place for axis in palletiser] == ["1", "2", "3", "6"]


SIMPLE = Program("p", ARM, (Move((0.0,) * 6, (1, 1)),))
SEVEN = Program("p", axes_of("abcdefg", ["revolute"] * 7), (Move((0.0,) * 7, (1, 1)),))
FIVE = Program("p", axes_of("abcde", ["revolute"] * 5), (Move((0.0,) * 5, (1, 1)),))
SLIDER = Program(
    "p", axes_of("abcdef", [*["revolute"] * 5, "prismatic"]), (Move((0.0,) * 6, (1, 1)),)
)


def asking(*signals: str) -> Program:
    """A program with a handshake."""
    return replace(SIMPLE, steps=(*SIMPLE.steps, Wait("read", signals)))


@pytest.mark.parametrize(
    ("brand", "program", "said"),
    [
        ("krl", replace(SIMPLE, name="a" * 25), "at most 24"),
        ("krl", replace(SIMPLE, name="Wait"), "is a word of krl"),
        ("krl", replace(SIMPLE, name="1st"), "a letter first"),
        ("rapid", replace(SIMPLE, name="a" * 29), "at most 28"),
        ("fanuc_ls", replace(SIMPLE, name="my plan"), "letters, digits and _"),
        ("krl", SEVEN, "has 7 axes"),
        ("rapid", SEVEN, "has 7 axes"),
        ("urscript", FIVE, "has 5 axes"),
        ("urscript", SLIDER, "joint f slides"),
        ("urscript", replace(SIMPLE, axes=RAIL, steps=()), "axis E1 beside the robot"),
        ("krl", asking("do_1", "2"), r"signal 'do_1': expected a number"),
        ("urscript", asking("1", "8"), r"signal '8': expected a standard signal"),
        ("rapid", asking("1", "2"), r"signal '1': expected the name"),
        ("fanuc_ls", replace(SIMPLE, steps=(Dwell(400.0),)), "327.67 s at most"),
    ],
)
def test_what_a_controller_does_not_take_is_refused(
    brand: str, program: Program, said: str
) -> None:
    """One line says what is too long, too many or of another kind."""
    with pytest.raises(ProgramError, match=said):
        writer.get(brand).files(program)


def test_what_no_program_has_is_refused() -> None:
    """Two joints at one axis, no such axis, no speed, negative times, targets that miss one."""
    kinds = ["revolute"] * 2
    for places, said in (("1,1", "one axis"), ("1,A2", "'A2' of joint b"), ("1", "1 axes")):
        with pytest.raises(ProgramError, match=said):
            Program("p", axes_of("ab", kinds, places), ())
    with pytest.raises(ProgramError, match="above 0, at most 100"):
        replace(SIMPLE, speed_percent=0.0)
    with pytest.raises(ProgramError, match="from 0 on"):
        replace(SIMPLE, steps=(Dwell(-1.0),))
    with pytest.raises(ProgramError, match="each of 6 axes"):
        replace(SIMPLE, steps=(Move((1.0,)),))


def test_an_unknown_writer_lists_those_that_there_are() -> None:
    """A miss says what could have been meant."""
    with pytest.raises(ProgramError, match=r"available: .*krl.*rapid"):
        writer.get("kuka")
    assert set(READERS) <= set(writer.available())


PLUGIN = '''
"""A writer of somebody else's."""

from edtk.programs.writer import Writer


class Words(Writer):
    """A program in one word."""

    name = "words"
    title = "words"
    suffixes = (".txt",)
    longest_name = 9

    def write(self, program):
        return {".txt": program.name}
'''


def test_a_package_adds_a_writer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An entry point is enough; one that does not load, or is no writer, is a line by its name."""
    (tmp_path / "words_of_mine.py").write_text(PLUGIN)
    folder = tmp_path / "words-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: words\nVersion: 1.0\n")
    entries = ("words = words_of_mine:Words", "gone = no_such_module:Gone", "other = json:loads")
    (folder / "entry_points.txt").write_text("\n".join(["[edtk.programs]", *entries]))
    monkeypatch.syspath_prepend(tmp_path)
    assert {"words", "gone"} <= set(writer.available())
    try:
        assert writer.get("words").files(SIMPLE) == {".txt": "p"}
    finally:
        writer._registered.pop("words", None)
    with pytest.raises(ProgramError, match="'no_such_module:Gone' does not load"):
        writer.get("gone")
    with pytest.raises(ProgramError, match="'json:loads' is no Writer class"):
        writer.get("other")
