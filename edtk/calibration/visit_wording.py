"""The sentences of findings on what visits and markers share."""

from edtk.calibration.finding import Finding, Kind

ON_VISITS = (Kind.MOVING_JOINTS,)


def visit_wording(found: Finding) -> str:
    """One line that says what moves together, and what to write into the study."""
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
