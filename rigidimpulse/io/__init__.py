"""Scenes from files and motion to files. Nothing here is imported before it is used.

scene_file   scenes by suffix                        pieces   colliders joined to bodies, and weighed
motion_file  motion by suffix                        jointed  bodies that touch at a joint
motion       keys of a whole run                     origin   what is kept of a file
keys         times and poses of a body's animation   gltf, usd, robots: by format
table        a recording as text                     named_files  files that a file names
"""
