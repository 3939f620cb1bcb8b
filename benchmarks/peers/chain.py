"""Prints an MJCF chain of hinges about y and z in turn, with springs, that falls into its weight: a scene which every peer
can run (docs/benchmarks.md).

    python3 benchmarks/peers/chain.py JOINTS [STIFFNESS [DAMPING]] > chain.xml
"""

import sys


def chain(joints, stiffness=100.0, damping=1.0):
    lines = [
        f'<mujoco model="chain{joints}">',
        '  <option gravity="0 0 -9.81"/>',
        f'  <custom><text name="fork1s_interface" data="link{joints - 1}"/></custom>',
        f'  <default><joint stiffness="{stiffness:g}" damping="{damping:g}"/>',
        '    <geom contype="0" conaffinity="0" type="capsule" size="0.01" fromto="0 0 0 0.05 0 0"/></default>',
        "  <worldbody>",
    ]
    for i in range(joints):
        axis = "0 1 0" if i % 2 == 0 else "0 0 1"
        lines += [
            f'<body name="link{i}" pos="{0.05 if i else 0} 0 0"><joint name="joint{i}" axis="{axis}"/><geom/>',
            '<inertial pos="0.025 0 0" mass="0.02" diaginertia="1e-6 5e-6 5e-6"/>',
        ]
    return "\n".join(lines) + "</body>" * joints + "\n  </worldbody>\n</mujoco>"


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    print(chain(int(sys.argv[1]), *map(float, sys.argv[2:])))
