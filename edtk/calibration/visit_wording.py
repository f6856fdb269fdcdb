"""The sentences of findings on what visits and markers share."""

from edtk.calibration.finding import Finding, Kind

ON_VISITS = (Kind.MOVING_JOINTS, Kind.REPEATABILITY)


def visit_wording(found: Finding) -> str:
    """One line that says what moves together, and what to write into the study."""
    if found.kind is Kind.REPEATABILITY:
        return _repeatability(found)
    data = found.data
    test = f"F = {data['F']:.3g}, p = {data['p']:.1g}"
    moved = f"by {1e3 * data['moved']:.2g} mm ({test}), as where joints do not return exactly"
    used = "it is taken into account, and " if data["used"] else ""
    write = f"{used}repeatability_deg = {data['joints']:.2g} in the study's [noise] states it"
    if data["revisited"]:
        return f"all markers of a visit move together {moved}: {write}"
    return (
        f"markers of a pose are off together {moved}, or the model does not fit (visiting poses "
        f"again would tell): {write}"
    )


def _repeatability(found: Finding) -> str:
    """Joints that return better or worse than the study states."""
    data = found.data
    size = f"{data['joints']:.2g} +- {data['std']:.1g} deg"
    return (
        f"visits say that joints return within {size}, stated {data['stated']:.3g} deg "
        f"(p = {data['p']:.1g}): repeatability_deg in the study's [noise] is wrong, or poses are"
    )
