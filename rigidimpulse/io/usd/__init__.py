"""USD: scenes with UsdPhysics in, and motion as time samples out. Needs the package usd-core (extra `usd`).

library    the package, where it is installed     layer     prims and values written through Sdf
draw       bodies without a file, as prims        animate   motion into a file
"""
