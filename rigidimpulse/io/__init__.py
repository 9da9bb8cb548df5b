"""Scenes from files and motion to files. Nothing here is imported before it is used."""
