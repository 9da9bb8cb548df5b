"""Coordinates of joints: what a row of a joint measures and constrains. `dynamics/constraints/joint` says how each is computed."""

ALONG, RADIUS, DISTANCE, ABOUT, TWIST, SWING, ANGLE, ACROSS = 0, 3, 6, 7, 10, 13, 16, 17
"""ALONG, RADIUS, ABOUT, TWIST and SWING plus the axis k; ACROSS plus 3 k + i."""
