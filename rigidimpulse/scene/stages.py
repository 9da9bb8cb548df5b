"""The stages of a step: what an effect of a scene may name as its `stage`."""

STAGES = ("detect", "respond", "forces", "constrain", "sweep", "integrate", "observe")
"""In the order in which the state of a body meets them."""
