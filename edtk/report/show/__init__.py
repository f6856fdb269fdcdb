"""Poses to look at: a page on which the arm moves, and a plate of small pictures for paper."""
