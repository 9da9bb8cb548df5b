"""Looking at recordings: one-file HTML pages and a live page, both meshcat's viewer with a stage around it."""

from __future__ import annotations

from rigidimpulse.view.page import render_page, write_html
from rigidimpulse.view.server import Viewer, show

__all__ = ["Viewer", "render_page", "show", "write_html"]
