"""Functions over a whole box of design variables, bounded from above with a proof."""
