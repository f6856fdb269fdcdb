"""Text of how the search for a plan went."""


def search_summary(starts: int, seconds: float, found: int, optima: int) -> str:
    """Such as "128 starts in 25.2 s ended in 4 different plans, 3 times in this one".

    Args:
        starts: Number of starts.
        seconds: How long the search took [s].
        found: How many of the plans that were refined to the end came out as the best one.
        optima: How many different plans they came out as.
    """
    times = {1: "once", 2: "twice"}.get(found, f"{found} times")
    begun = f"{starts} start{'' if starts == 1 else 's'} in {seconds:.1f} s"
    plans = f"{optima} different plans, {times} in" if optima > 1 else f"one plan, {times}:"
    return f"{begun} ended in {plans} this one"
