"""USD: scenes with UsdPhysics in, and motion as time samples out. Needs the package usd-core (extra `usd`).

library    the package, where it is installed     layer      prims and values written through Sdf
frames     world frames of prims, and their keys  shapes     colliders
materials  materials, masses, collision groups    bodies     bodies of them
joints     joints                                 load       a scene from a file
origin     what is kept of the file               draw       bodies without a file, as prims
animate    motion into a file                     plain      bodies of files without physics
instancing point instancers as prims              skinning   meshes whose bones move
layers     all layers of a file, checked
"""
