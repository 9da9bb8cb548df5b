"""The order of events of a run."""
