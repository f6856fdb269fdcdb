"""The error of candidates that cannot identify what has to be known."""


class RankDeficientError(ValueError):
    """The candidates cannot identify all parameters; the message names the open directions.

    Attributes:
        of_interest: Whether a criterion asked for some of the parameters only.
    """

    def __init__(self, message: str, of_interest: bool = False) -> None:
        super().__init__(message)
        self.of_interest = of_interest
