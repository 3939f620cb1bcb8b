#!/usr/bin/env python3
"""N boxes in rows on a floor, a gap [mm] apart, as MJCF: bodies that are near and never touch.

for n in 50 100 200 500; do for gap in 1 100; do python3 benchmarks/boxes_on_floor.py $n $gap > /tmp/boxes${n}_${gap}mm.xml; done; done
tools/step_instructions.sh --second 2 /tmp/boxes{50,100,200,500}_{1,100}mm.xml
"""

import math
import sys

SIDE = 0.1  # m


def model(boxes: int, gap: float) -> str:
    rows = math.ceil(math.sqrt(boxes))
    return "\n".join(
        [
            f'<mujoco model="{boxes} boxes on a floor">',
            f'<option timestep="{1 / 60}"/>',
            '<worldbody><geom type="plane" size="5 5 0.1"/>',
            *(
                f'<body pos="{k % rows * (SIDE + gap):.6g} {k // rows * (SIDE + gap):.6g} {SIDE / 2}"><freejoint/>'
                f'<geom type="box" size="{SIDE / 2} {SIDE / 2} {SIDE / 2}" mass="1"/></body>'
                for k in range(boxes)
            ),
            "</worldbody></mujoco>",
        ]
    )


if len(sys.argv) != 3 or not sys.argv[1].isdigit() or int(sys.argv[1]) < 1 or not float(sys.argv[2]) > 0:
    sys.exit("usage: boxes_on_floor.py BOXES GAP_IN_MM")
print(model(int(sys.argv[1]), float(sys.argv[2]) / 1000))
