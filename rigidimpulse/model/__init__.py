"""The compiled scene and the state of a run."""
