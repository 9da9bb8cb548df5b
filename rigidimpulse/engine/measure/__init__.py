"""A run measures itself: energy, momentum and overlap of the recorded frames, by other means than those that moved the bodies."""
