"""Colours and markers of all pictures."""

# Okabe-Ito, safe for colour-blind readers; further lines repeat them with other markers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7F7F7F")
MARKERS = "osD^vPX*<>hd"
BLUE = COLOURS[0]
ORANGE = COLOURS[1]
GREEN = COLOURS[2]
GREY = COLOURS[6]
