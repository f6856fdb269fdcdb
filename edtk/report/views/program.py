"""Robot programs: what they do, and what the plan is worth as the controller takes it."""

from edtk.calibration.robot_program import WrittenProgram
from edtk.programs.program import Dwell, Wait
from edtk.report.tables import notebook_table
from edtk.robots.joint import UNITS

LEAST = 1e-9  # [deg or mm]: below that it is the conversion to SI units and back


def _facts(found: WrittenProgram) -> list[tuple[str, str]]:
    """Pairs of what and how."""
    program = found.program
    axes = ", ".join(f"{axis.joint} = {axis.place}" for axis in program.axes)
    dwells = {step.seconds for step in program.steps if isinstance(step, Dwell)}
    rest = f"{max(dwells):g} s of rest before a reading" if dwells else "no rest before a reading"
    waits = [step for step in program.steps if isinstance(step, Wait)]
    asks = [step.signals for step in waits if step.signals is not None]
    read = "an operator starts the program again after each reading"
    if asks:
        read = f"output {asks[0][0]} asks for each reading, input {asks[0][1]} answers"
    homes = [move for move in program.moves if move.purpose == "home"]
    vias = sum(move.purpose == "via" for move in program.moves)
    return [
        ("files", ", ".join(found.files)),
        ("rows of the sheet", f"{found.rows}, in {found.visits} visits of {found.poses} poses"),
        ("axes", axes),
        ("moves", f"in step, at {program.speed_percent:g} % of the joints' speed, {rest}"),
        ("readings", read),
        ("home", "at both ends" if homes else "none: the first move begins where the arm stands"),
        ("via poses", f"{vias}" if vias else "none"),
        ("as rounded", _as_rounded(found)),
    ]


def _as_rounded(found: WrittenProgram) -> str:
    """What rounding does to the plan."""
    kinds = {axis.kind for axis in found.program.axes}
    units = " or ".join(UNITS[kind] for kind in sorted(kinds, reverse=True))
    change = f"by {found.rounding:.1g} {units} at most" if found.rounding > LEAST else "no change"
    if found.efficiency is None:
        return f"{change}; {found.criterion} is not known of this plan"
    return f"{change}; {100 * found.efficiency:.4f} % of the plan's efficiency by {found.criterion}"


def written_program_text(found: WrittenProgram) -> str:
    """A line for each fact."""
    facts = _facts(found)
    width = max(len(what) for what, _ in facts)
    return "\n".join([found.headline(), *(f"  {what:{width}}  {how}" for what, how in facts)])


def written_program_notebook(found: WrittenProgram) -> str:
    """The same as a table."""
    return notebook_table(found.headline(), ["what", "how"], [list(fact) for fact in _facts(found)])
