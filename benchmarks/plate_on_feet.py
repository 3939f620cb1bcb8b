#!/usr/bin/env python3
"""A plate on N ball feet, as MJCF: one body with N contacts.

for n in 4 8 16 32 64; do python3 benchmarks/plate_on_feet.py $n > /tmp/feet$n.xml; done
tools/step_instructions.sh --second 2 /tmp/feet{4,8,16,32,64}.xml
"""

import math
import sys

GAP = 0.05  # m between feet
RADIUS = 0.01  # m


def model(feet: int) -> str:
    side = math.ceil(math.sqrt(feet))
    middle = (side - 1) / 2
    balls = [
        f'<geom type="sphere" size="{RADIUS}" mass="0.01" '
        f'pos="{GAP * (k // side - middle)} {GAP * (k % side - middle)} {-RADIUS}"/>'
        for k in range(feet)
    ]
    return "\n".join(
        [
            f'<mujoco model="plate on {feet} feet">',
            f'<option timestep="{1 / 60}"/>',
            '<worldbody><geom type="plane" size="2 2 0.1"/>',
            f'<body name="plate" pos="0 0 {2 * RADIUS}"><freejoint/>',
            '<geom type="box" size="0.3 0.3 0.005" mass="2"/>',
            *balls,
            "</body></worldbody></mujoco>",
        ]
    )


if len(sys.argv) != 2 or not sys.argv[1].isdigit() or int(sys.argv[1]) < 1:
    sys.exit("usage: plate_on_feet.py FEET")
print(model(int(sys.argv[1])))
