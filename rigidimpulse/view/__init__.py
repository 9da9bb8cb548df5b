"""Recordings in the browser: one-file HTML pages and a live page. Both are meshcat's viewer with a stage around it."""
