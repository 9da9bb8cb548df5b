"""The ten-line program of the README: a cow falls on the floor."""

import rigidimpulse as ri
from rigidimpulse.gallery import asset_path

scene = ri.Scene(gravity=(0, 0, -9.81))
scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
hide = ri.Material(density=700, restitution=0.4, static_friction=0.6, dynamic_friction=0.5)
cow = ri.Shape.from_file(asset_path("spot.obj"), scale=0.5)
scene.add(ri.Body("spot", cow, position=(0, 0, 2), orientation=(1, 1, 0, 0), angular_velocity=(0, 3, 0), material=hide))
run = ri.simulate(scene, duration=3.0, fps=60)
print(run.plan.explain())
print(f"{len(run.impacts)} impacts, {run.status.message}, at rest at {run.position('spot')[-1].round(3)}")
run.export("first_program.html")
