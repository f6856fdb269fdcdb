"""From a filled-in sheet to compliances, to a verdict, and to corrected commands."""
