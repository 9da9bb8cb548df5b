"""Energies whose minimum is wanted: terms on the poses of a scene's bodies, and on paths."""
