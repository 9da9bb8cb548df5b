"""What this package provides to lower layers: until when a recording can be trusted, and runs to an accuracy target."""

from __future__ import annotations

from rigidimpulse.core.providers import provide

provide("horizon", "rigidimpulse.studies.horizon:find_horizon")
provide("simulate to target", "rigidimpulse.studies.accuracy_targets:simulate_to_target")
