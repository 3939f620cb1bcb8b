"""Bullet (pybullet, its Featherstone bodies): it has no springs at joints, so that they are torques of the position and rate
at the start of every step, as its examples have them. Dampers are its own joint damping."""

import sys

import numpy as np
import pybullet
from tree import principal, serve


class Bullet:
    name, package = "Bullet", "pybullet"
    setup = "springs as torques at the start of a step, explicit; dampers its own"

    def __init__(self, bodies, gravity, dt):
        p = pybullet
        p.connect(p.DIRECT)
        p.setGravity(*gravity)
        p.setPhysicsEngineParameter(fixedTimeStep=dt, numSubSteps=0)
        links = {k: [] for k in ("mass", "position", "turn", "inertial", "inertial_turn", "parent", "kind")}
        for b in bodies:
            if b.joint is not None and (np.linalg.norm(b.joint.anchor) > 1e-12 or b.joint.armature):
                raise ValueError("this program takes joints through the origin of their body, without rotors")
            moments, axes = principal(b.inertia)
            links["mass"].append(b.mass)
            links["position"].append(list(b.X_PB[:3, 3]))
            links["turn"].append(quaternion(b.X_PB[:3, :3]))
            links["inertial"].append(list(b.center))
            links["inertial_turn"].append(quaternion(axes))
            links["parent"].append(b.parent + 1)
            kind = (
                p.JOINT_FIXED if b.joint is None else p.JOINT_REVOLUTE if b.joint.turns else p.JOINT_PRISMATIC
            )
            links["kind"].append(kind)
        count = len(bodies)
        # A link without a shape keeps no inertia and no damping of changeDynamics.
        grain = p.createCollisionShape(p.GEOM_SPHERE, radius=1e-3)
        self.body = p.createMultiBody(
            baseMass=0,
            linkMasses=links["mass"],
            linkCollisionShapeIndices=[grain] * count,
            linkVisualShapeIndices=[-1] * count,
            linkPositions=links["position"],
            linkOrientations=links["turn"],
            linkInertialFramePositions=links["inertial"],
            linkInertialFrameOrientations=links["inertial_turn"],
            linkParentIndices=links["parent"],
            linkJointTypes=links["kind"],
            linkJointAxis=[list(b.joint.axis) if b.joint else [1.0, 0, 0] for b in bodies],
        )
        self.index = {b.name: i for i, b in enumerate(bodies)}
        self.moving = [i for i, b in enumerate(bodies) if b.joint is not None]
        joints = [bodies[i].joint for i in self.moving]
        self.stiffness = np.array([j.stiffness for j in joints])
        self.rest = np.array([j.rest for j in joints])
        for i, b in enumerate(bodies):
            moments, _ = principal(b.inertia)
            p.setCollisionFilterGroupMask(self.body, i, 0, 0)
            p.changeDynamics(self.body, i, linearDamping=0, angularDamping=0, maxJointVelocity=1e9)
            p.changeDynamics(self.body, i, jointDamping=b.joint.damping if b.joint else 0)
            # By itself and last: in one call with the others it is forgotten.
            p.changeDynamics(self.body, i, localInertiaDiagonal=list(moments))
            if not np.allclose(p.getDynamicsInfo(self.body, i)[2], moments, rtol=1e-6):
                raise ValueError(f"Bullet does not take the inertia of body '{b.name}'")
        p.setJointMotorControlArray(
            self.body, self.moving, p.VELOCITY_CONTROL, forces=[0.0] * len(self.moving)
        )

    def step(self):
        p = pybullet
        q = np.array([s[0] for s in p.getJointStates(self.body, self.moving)])
        p.setJointMotorControlArray(
            self.body, self.moving, p.TORQUE_CONTROL, forces=list(self.stiffness * (self.rest - q))
        )
        p.stepSimulation()

    def position(self, name):
        return pybullet.getLinkState(self.body, self.index[name], computeForwardKinematics=True)[4]


def quaternion(R):
    """x, y, z, w of a rotation."""
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
            [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
            [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], 0],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]],
        ]
    )
    _, vectors = np.linalg.eigh(K / 3)
    return list(vectors[:, -1])


if __name__ == "__main__":
    sys.exit(serve(Bullet))
