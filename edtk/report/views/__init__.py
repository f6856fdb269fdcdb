"""How each result shows itself: as text, in a notebook, as a picture."""
