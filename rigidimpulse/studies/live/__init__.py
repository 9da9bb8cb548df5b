"""A scene that is computed and shown at the same time: sliders, a file that is watched, bodies that are thrown."""
