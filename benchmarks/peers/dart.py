"""DART (dartpy): springs and dampers of joints, which it takes implicitly."""

import sys

import dartpy
import numpy as np
from tree import serve

Isometry3 = dartpy.math.Isometry3


def isometry(X):
    out = Isometry3()
    out.set_rotation(X[:3, :3])
    out.set_translation(X[:3, 3])
    return out


def frame_at(anchor):
    X = np.eye(4)
    X[:3, 3] = anchor
    return X


class Dart:
    name, package = "DART", "dartpy"
    setup = "springs and dampers of joints, implicit"

    def __init__(self, bodies, gravity, dt):
        self.world = dartpy.simulation.World()
        self.world.setGravity(gravity)
        self.world.setTimeStep(dt)
        self.skeleton = dartpy.dynamics.Skeleton("tree")
        self.nodes = []
        for b in bodies:
            parent = self.nodes[b.parent] if b.parent >= 0 else None
            joint, node = self.add(b, parent)
            anchor = frame_at(b.joint.anchor) if b.joint else np.eye(4)
            joint.setTransformFromParentBodyNode(isometry(b.X_PB @ anchor))
            joint.setTransformFromChildBodyNode(isometry(anchor))
            inertia = dartpy.dynamics.Inertia(b.mass, b.center, b.inertia)
            node.setInertia(inertia)
            node.setName(b.name)
            self.nodes.append(node)
        self.world.addSkeleton(self.skeleton)
        self.by_name = {b.name: n for b, n in zip(bodies, self.nodes)}

    def add(self, b, parent):
        d = dartpy.dynamics
        if b.joint is None:
            return self.skeleton.createWeldJointAndBodyNodePair(parent)
        if b.joint.armature:
            raise ValueError("DART has no inertia of rotors at joints")
        make, kind = (
            (self.skeleton.createRevoluteJointAndBodyNodePair, d.RevoluteJointProperties)
            if b.joint.turns
            else (self.skeleton.createPrismaticJointAndBodyNodePair, d.PrismaticJointProperties)
        )
        properties = kind()
        properties.mName = b.joint.name
        properties.mAxis = b.joint.axis
        joint, node = make(parent, properties)
        joint.setSpringStiffness(0, b.joint.stiffness)
        joint.setDampingCoefficient(0, b.joint.damping)
        joint.setRestPosition(0, b.joint.rest)
        return joint, node

    def step(self):
        self.world.step()

    def position(self, name):
        return self.by_name[name].getTransform().translation()


if __name__ == "__main__":
    sys.exit(serve(Dart))
