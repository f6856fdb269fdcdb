"""The wrenches that an experiment may apply, one kind of choice a file (Eq. 21-22)."""
