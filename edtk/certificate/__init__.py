"""Certificates: what proves the numbers of a plan, and a second way to compute them."""
