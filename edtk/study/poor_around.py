"""Whether a plan that serves the test poses is poor around them."""

import numpy as np

from edtk.model.expected_error import ExpectedError

SEVERAL = 3.0  # times the error in the test pose: plans for all parameters have about the same


def poor_around(expected: ExpectedError) -> tuple[str, ...]:
    """A sentence where the error around the test poses is several times that in them.

    Args:
        expected: Errors to expect of the plan.
    """
    # What is told exactly in a test pose is compared with nothing.
    if not 0 < SEVERAL * expected.test_pose < expected.mean:
        return ()
    one = expected.poses == 1
    where = "the test pose" if one else f"the {expected.poses} test poses"
    return (
        f"errors are {expected.mean / expected.test_pose:.2g} times as large around {where} as "
        f"there: {1e3 * expected.mean:.2g} mm within {np.rad2deg(expected.within):.3g} deg on "
        f"average, {1e3 * expected.test_pose:.2g} mm in {'it' if one else 'them'}; give more test "
        "poses where the robot shall work, or optimise another criterion such as A",
    )
