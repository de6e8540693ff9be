"""Load a URDF whose root link is a spacecraft, and mount an arm that has none.

``python scripts/01_load_a_urdf.py`` ends in the mass of a servicer with a stock arm [kg].

Every plan begins with a model: bodies, joints and masses. The root link of the URDF is the
spacecraft; the chain from it to the end-effector is the arm.
"""

import numpy as np

import freefloat as ff

# Any URDF will do whose root link is the spacecraft: a file, or the name of a bundled one, as here
# the robots of the paper's Examples 1 and 2.
for robot in ("planar_3dof", "spatial_6dof"):
    model = ff.FreeFloatingModel.from_urdf(robot, end_effector="end_effector")
    print(f"{robot}: {model.total_mass:g} kg, {model.dof} joints that move")
    for name, body in zip(model.joint_names, model.bodies[1:], strict=True):
        print(f"  {name}: moves {body.mass:g} kg")
    # Warnings about the URDF, with their lines.
    for warning in model.warnings:
        print(f"  line {warning.line}, {warning.element}: {warning.problem}")

# An arm without a spacecraft gets one: a box of 1 m and 200 kg, the arm on its front.
spacecraft = ff.Spacecraft(
    mass=200.0,
    inertia=np.diag([35.0, 35.0, 35.0]),  # about its centre of mass [kg m²]
    size=(1.0, 1.0, 1.0),
    mount=ff.so3.Pose([0.5, 0.0, 0.0], np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])),
)
servicer = ff.FreeFloatingModel.from_urdf(
    "example-robot-data:ur5", end_effector="tool0", spacecraft=spacecraft
)
print(f"ur5 on a spacecraft: {', '.join(servicer.joint_names)}")
print(f"total mass: {servicer.total_mass:.4f} kg")
