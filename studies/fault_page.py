"""The tables of fault_table.md."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from fault_bounds import SPREAD, Bound
from fault_robots import robots
from fault_shares import (
    ERRORS,
    EXPERIMENTS,
    GOOD,
    LEAST_RIGHT,
    MOST_ALARMS,
    MOST_FALSE,
    PLANS,
    Cell,
    Shares,
)
from faults import FAULTS

from edtk.report.tables import markdown_table

# By robot, plan and how often each experiment is measured, and by fault.
Possible = Mapping[tuple[str, str, int], Mapping[str, Bound]]

REPEATS = (1, 3)
HEADER = (
    "fault",
    "sheets",
    "optimal: detected",
    "before",
    "named first",
    "or second",
    "wrongly named",
    "random: detected",
    "before",
    "named first",
    "or second",
    "wrongly named",
)
INTRODUCTION = (
    "# Are faults found, and named?\n\n"
    "`python studies/fault_table.py` wrote this file; it ends with code 1 if a target is "
    "missed.\n\n"
    "The truth is the loaded, nonlinear equilibrium "
    "of the robot, with the stated noise; the sheet is written to a file and judged by "
    "`edtk.identify`, as a user does it. *Optimal* is a plan of "
    f"`edtk plan` with {EXPERIMENTS} experiments, of which some share a pose; *random* are "
    f"{EXPERIMENTS} feasible poses, new ones for each sheet. Directions, signs, joints and "
    "poses of faults are drawn by chance. All shares are in percent. Where the numbers of sheets "
    "differ, the first is that of the optimal plan.\n\n"
    "How to read the columns:\n\n"
    '- *Detected*: the verdict is not "good", or the sheet is refused.\n'
    "- *Before*: the same share before there was a nonlinear fit and before causes were named, of "
    "60 sets of the KR 270, each experiment measured once. It is not known for other robots. How "
    "large backlash was then is not known either: the last three rows of the KR 270 are sizes at "
    "which a test of the sum of squares, as it was made then, finds as many. For a joint that is "
    "drawn by chance there is no such size.\n"
    "- *Named first*: of the detected sheets, those whose first cause is right. A sheet that is "
    "refused by the name of its fault counts. A wrong pose is right if its rows are. Noise that "
    "repetitions share, and outliers, have lines of their own, and are right if no cause is "
    "blamed.\n"
    "- *Or second*: of the detected sheets, those that name the right cause first, or as a second "
    "one that is about as likely.\n"
    "- *Wrongly named*: of all sheets, those whose first cause is another one.\n\n"
    "Rows of 20 sheets are of faults that were added later.\n\n"
    "A load that is 10 % off scales all displacements, as softer joints do: no measurement of "
    "displacements tells these apart. It is seen only where compliances are known beforehand, "
    "and the error budget has a part for it. Only a factor as large as that of two units is "
    "told from the sizes that residuals, and the compliances of [simulation], have. With a "
    "torque of one sign in all poses, a joint's dependence on that sign is no fault of the "
    "plan; such joints are left out. Random poses that are measured once are repeated nowhere, "
    "so that no noise is common to any.\n\n"
    f"Targets: a cause named in at most {MOST_FALSE:g} % of good sheets, p < 0.01 in at most "
    f"{MOST_ALARMS:g} %, the right cause first in at least {LEAST_RIGHT:g} % of those "
    "detected, and detection no worse than before; a place misses one if it is off by more "
    f"than {ERRORS:g} standard errors of so many sheets.\n"
)
POSSIBLE = (
    "## What is possible\n\n"
    "Each experiment measured once. *Sum of squares*: detected by p < 0.01 of all residuals "
    "alike, as before. *Best test*: the likelihood ratio of the fault, drawn by chance as above, "
    "against good data. Of all tests with as many false alarms as `edtk.identify` has, it "
    "detects most (Neyman and Pearson); it knows which fault it looks for, and how large that "
    "is. *Best naming*: of the sheets that the best test for all faults at once detects, those "
    "whose cause has the largest mean likelihood, all causes being equally likely (Bayes). No "
    "naming is right more often on the average over the causes; one that is better for one "
    "cause is worse for another. It never says that it is none of these, as `edtk.identify` does "
    "where no cause is clear enough after looking at all. It knows the sizes that faults have "
    "here; in the second column "
    f"only within a factor of {SPREAD:g} to either side, which is about what anybody knows. To "
    "first order in the faults; random plans are the means of some.\n"
)
POSSIBLE_HEADER = (
    "fault",
    "plan",
    "sum of squares",
    "detected",
    "best test",
    "named first",
    "best naming",
    "of unknown size",
)


def page(
    table: Sequence[tuple[Cell, Shares]], missed: Sequence[Sequence[str]], possible: Possible
) -> str:
    """The report, as Markdown."""
    by_place = {
        (cell.robot, cell.fault, cell.repeats, cell.poses is None): shares
        for cell, shares in table
        if cell.size == EXPERIMENTS
    }
    parts = [INTRODUCTION]
    for robot in robots():
        for repeats in REPEATS:
            times = "once" if repeats == 1 else f"{repeats} times"
            parts.append(f"## {robot}: each experiment measured {times}\n")
            rows = [
                _row(by_place, robot, number, repeats)
                for number in range(len(FAULTS))
                if _is_there(by_place, robot, number, repeats)
            ]
            parts.append(markdown_table(HEADER, rows))
    parts.append(POSSIBLE)
    for robot in robots():
        parts.append(f"### {robot}\n")
        parts.append(markdown_table(POSSIBLE_HEADER, _possible_rows(by_place, robot, possible)))
    good = [
        (
            cell.robot,
            cell.size,
            shares.sets,
            _words(shares.detected),
            _words(shares.unlikely),
            _words(shares.wrong),
        )
        for cell, shares in table
        if FAULTS[cell.fault] is GOOD and cell.repeats == 1 and cell.poses is None
    ]
    head = ("robot", "random poses", "sheets", "verdict not good", "p < 0.01", "a cause named")
    parts.append("## False alarms: good sheets of random poses, each measured once\n")
    parts.append(markdown_table(head, good))
    parts.append("## Missed targets\n")
    head = ("robot", "fault", "plan", "share", "asked", "found", "best possible")
    rows = [[*miss, _best(miss, possible)] for miss in missed]
    parts.append(markdown_table(head, rows) if missed else "None.\n")
    return "\n".join([*parts, *_out_of_reach(missed, possible)])


def _bound(miss: Sequence[str], possible: Possible) -> Bound | None:
    """What is possible in a place where a target is missed; None where that is not known."""
    robot, title, plan, *_ = miss
    kind, _, rest = plan.partition(" ")
    _, _, times = rest.partition(", ")
    repeats = 1 if times == "once" else int(times.split()[0])
    return possible.get((robot, kind, repeats), {}).get(title)


def _best(miss: Sequence[str], possible: Possible) -> str:
    """What is possible where a target is missed: of naming, with sizes unknown and known."""
    bound = _bound(miss, possible)
    if bound is None:
        return "-"
    if miss[3] == "detected":
        return f"{bound.detected:.0f} %"
    low, high = sorted((bound.named_unknown, bound.named))
    return f"{low:.0f} to {high:.0f} %"


def _out_of_reach(missed: Sequence[Sequence[str]], possible: Possible) -> Iterator[str]:
    """Sentences on the places in which no naming reaches what is asked."""
    never = []
    unknown = []
    for miss in missed:
        bound = _bound(miss, possible)
        if bound is None or not miss[3].startswith("named first"):
            continue
        best = max(bound.named, bound.named_unknown)
        if best < LEAST_RIGHT:
            never.append(f"{best:.0f} % ({miss[0]}: {miss[1]}, {miss[2]})")
        elif bound.named_unknown < LEAST_RIGHT:
            unknown.append(f"{bound.named_unknown:.0f} % ({miss[0]}: {miss[1]}, {miss[2]})")
    if never:
        yield (
            f"{LEAST_RIGHT:g} % are out of reach, even of the best possible naming, in these "
            f"places, where it is right in {'; '.join(never)}.\n"
        )
    if unknown:
        yield (
            "Without knowing the size of the fault, the best possible naming is right in "
            f"{'; '.join(unknown)}.\n"
        )


def _is_there(
    by_place: dict[tuple[str, int, int, bool], Shares], robot: str, number: int, repeats: int
) -> bool:
    """Whether a fault was simulated: not all robots and plans have all faults."""
    found = [by_place.get((robot, number, repeats, kind)) for kind in (False, True)]
    return any(shares is not None and shares.sets > 0 for shares in found)


def _row(
    by_place: dict[tuple[str, int, int, bool], Shares], robot: str, number: int, repeats: int
) -> list[str]:
    """A fault as a row of a robot's table."""
    fault = FAULTS[number]
    words = fault.today.split(" / ") if fault.today else ["", ""]
    both = [by_place[robot, number, repeats, is_random] for is_random in (False, True)]
    sets = dict.fromkeys(shares.sets for shares in both if shares.sets)
    row = [fault.title, " / ".join(map(str, sets))]
    for is_random, before in zip((False, True), words, strict=True):
        shares = by_place[robot, number, repeats, is_random]
        named = _words(shares.right) if fault.cause_is_seen else ""
        if fault.joint_is_asked and named:
            named += f" (joint too: {_words(shares.joint)})"
        among = _words(shares.among) if fault.cause_is_seen else ""
        row += [_words(shares.detected), before, named, among, _words(shares.wrong)]
    return row


def _possible_rows(
    by_place: dict[tuple[str, int, int, bool], Shares], robot: str, possible: Possible
) -> list[list[str]]:
    """What is possible beside what is, for each fault and plan."""
    rows = []
    for number, fault in enumerate(FAULTS):
        for is_random, kind in enumerate(PLANS):
            bound = possible[robot, kind, 1].get(fault.title)
            if bound is None or not _is_there(by_place, robot, number, 1):
                continue
            shares = by_place[robot, number, 1, bool(is_random)]
            if not shares.sets:
                continue
            pairs = (
                (bound.plain, shares.detected, bound.detected),
                (shares.right, bound.named, bound.named_unknown),
            )
            rows.append([fault.title, kind, *(_words(share) for pair in pairs for share in pair)])
    return rows


def _words(share: float) -> str:
    """A share [%] without decimals; a dash for that of nothing."""
    return "-" if np.isnan(share) else f"{share:.0f}"
