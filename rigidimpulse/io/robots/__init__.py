"""Robots: URDF and MJCF files in (extra `robot`).

links    links and joints of both formats as bodies and joints    urdf    URDF, read from its XML
mjcf     MJCF, compiled by MuJoCo itself                         xml     XML files, read safely
"""
