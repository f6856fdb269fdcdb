"""Errors of names, registrations and plug-ins."""


class CriterionError(LookupError):
    """A criterion's name, registration or construction is wrong, or a plug-in fails."""


class UnknownCriterionError(CriterionError):
    """No criterion has that name."""


class MissingTargetError(CriterionError):
    """A criterion needs the test pose's regressor, and none is given."""


class DuplicateCriterionError(CriterionError):
    """Two criteria claim one name."""
