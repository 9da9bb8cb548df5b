"""glTF 2.0: scenes with KHR_physics_rigid_bodies and KHR_implicit_shapes in and out, and motion as animated nodes.

schema      the JSON that is read, checked        container       files, buffers, accessors, and writing
nodes       hierarchy and transforms              animation       animated nodes as keyframes
geometry    meshes                                implicit        shapes given by figures
load        a scene from a file                   bodies, joints  its bodies and joints
plain       bodies of files without physics       origin          what is kept of the file
draw        bodies without a file, as meshes      animate         motion into a file
write, write_joints    a scene as a file with physics, its joints
own_materials          what only our files say of materials
instancing  a node for each instance               extensions      what a written file uses and requires
"""
