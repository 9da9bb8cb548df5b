"""Runs on disk: what is recorded while they go on, and checkpoints from which they go on after a crash."""
