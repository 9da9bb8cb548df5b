"""What this package provides to lower layers: recordings as pages, and the viewer."""

from __future__ import annotations

from rigidimpulse.core.providers import provide
from rigidimpulse.recording.exporters import register_exporter

register_exporter((".html",), "rigidimpulse.view.page:export_html", needs_shapes="an HTML page")
provide("show", "rigidimpulse.view.server:show")
provide("cell of scene", "rigidimpulse.view.cells:scene_cell")
provide("cell of recording", "rigidimpulse.view.cells:recording_cell")
provide("cell of plan", "rigidimpulse.view.cells:plan_cell")
