"""A linear combination of parameters in words."""

from criteria.linalg.typing import Array


def combination(factors: Array, parameters: tuple[str, ...]) -> str:
    """Words for a combination with these factors (p,), such as "k4", "k2 - 0.5 k3" or "- 2 k1"."""
    words = []
    for factor, name in zip(factors, parameters, strict=True):
        if factor:
            term = f"{abs(factor):.3g} {name}".removeprefix("1 ")
            words.append(f"{'-' if factor < 0 else '+'} {term}")
    return " ".join(words).removeprefix("+ ")


def combination_names(K: Array) -> tuple[str, ...]:
    """Words for combinations of parameters that are called k1 .. kp."""
    parameters = tuple(f"k{i + 1}" for i in range(len(K)))
    return tuple(combination(column, parameters) for column in K.T)
