"""What is kept of a run: frames, impacts, the ledger, events."""
