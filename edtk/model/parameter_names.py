"""Names of compliances."""

from collections.abc import Sequence


def parameter_names(joints: Sequence[str]) -> tuple[str, ...]:
    """Names of the compliances of joints: k2 for joint q2, and k_NAME for a joint of another name.

    Args:
        joints: Names of the joints.
    """
    numbered = [name[:1] == "q" and name[1:].isdigit() for name in joints]
    return tuple(
        f"k{name[1:]}" if number else f"k_{name}"
        for name, number in zip(joints, numbered, strict=True)
    )
