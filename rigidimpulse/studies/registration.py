"""What this package provides to lower layers: until when a recording can be trusted, and runs to an accuracy target."""

from __future__ import annotations

from rigidimpulse.core.providers import provide

provide("horizon", "rigidimpulse.studies.horizon:find_horizon")
provide("simulate to target", "rigidimpulse.studies.accuracy_targets:simulate_to_target")
provide("cell of study", "rigidimpulse.studies.cells:study_cell")
provide("cell of glance", "rigidimpulse.studies.cells:glance_cell")
provide("cell of wedge", "rigidimpulse.studies.cells:wedge_cell")
