"""Scenes from files and motion to files. Nothing here is imported before it is used.

scene_file  scenes by suffix       keys    times and poses of a body's animation
motion      keys of a whole run    origin  what is kept of a file
gltf, usd   by format
"""
