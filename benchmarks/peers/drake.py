"""Drake: a discrete plant with the SAP solver; springs are controller gains of actuators, which SAP takes implicitly, as its
documentation advises for stiff ones."""

import sys

sys.path.append(sys.path.pop(0))  # this folder has files of the simulators' names

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.analysis import Simulator
from tree import serve


def transform(X):
    return RigidTransform(RotationMatrix(X[:3, :3]), X[:3, 3])


class Drake:
    name, package = "Drake", "drake"
    setup = "discrete plant, SAP; springs as gains of actuators, implicit"

    def __init__(self, bodies, gravity, dt):
        plant = MultibodyPlant(time_step=dt)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector(gravity)
        self.bodies, rests = {}, []
        made = []
        for i, b in enumerate(bodies):
            I = b.inertia
            central = RotationalInertia(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
            inertia = SpatialInertia.MakeFromCentralInertia(b.mass, b.center, central)
            body = plant.AddRigidBody(b.name or f"body{i}", inertia)
            parent = plant.world_body() if b.parent < 0 else made[b.parent]
            made.append(body)
            self.bodies[b.name] = body
            if b.joint is None:
                plant.AddJoint(
                    WeldJoint(f"weld{i}", parent.body_frame(), body.body_frame(), transform(b.X_PB))
                )
                continue
            at = RigidTransform(b.joint.anchor)
            on_parent = plant.AddFrame(FixedOffsetFrame(f"P{i}", parent.body_frame(), transform(b.X_PB) @ at))
            on_body = plant.AddFrame(FixedOffsetFrame(f"B{i}", body.body_frame(), at))
            kind = RevoluteJoint if b.joint.turns else PrismaticJoint
            joint = plant.AddJoint(
                kind(b.joint.name or f"joint{i}", on_parent, on_body, b.joint.axis, damping=b.joint.damping)
            )
            if b.joint.stiffness or b.joint.armature:
                actuator = plant.AddJointActuator(f"spring{i}", joint)
                actuator.set_default_gear_ratio(1)
                actuator.set_default_rotor_inertia(b.joint.armature)
                if b.joint.stiffness:
                    actuator.set_controller_gains(PdControllerGains(p=b.joint.stiffness, d=0))
                rests.append(b.joint.rest)
        plant.Finalize()
        self.plant = plant
        self.simulator = Simulator(plant)
        self.context = self.simulator.get_mutable_context()
        if rests:
            port = plant.get_desired_state_input_port(plant.GetModelInstanceByName("DefaultModelInstance"))
            port.FixValue(self.context, np.concatenate([rests, np.zeros(len(rests))]))
        self.simulator.Initialize()
        self.dt, self.steps = dt, 0

    def step(self):
        self.steps += 1
        self.simulator.AdvanceTo(self.steps * self.dt)

    def position(self, name):
        return self.plant.EvalBodyPoseInWorld(self.context, self.bodies[name]).translation()


if __name__ == "__main__":
    sys.exit(serve(Drake))
