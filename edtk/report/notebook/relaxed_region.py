"""Table of a design over a region, for a notebook."""

from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.report.notebook_table import notebook_table
from edtk.report.text.relaxed_region import region_bounds, region_rows


def relaxed_region(result: RelaxedRegion) -> str:
    """A row for each point, and the bounds."""
    return notebook_table(result.headline(), *region_rows(result), region_bounds(result))
