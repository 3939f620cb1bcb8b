"""The fields of a contact."""

from typing import Any

import numpy as np
import numpy.typing as npt

CONTACT = np.dtype(
    [
        ("bodies", np.int32, (2,)),  # places in Simulation.bodies of a and b; -1: the still world
        ("point", np.float64, (3,)),  # m
        ("normal", np.float64, (3,)),  # unit vector from a to b
        ("force", np.float64, (3,)),  # N, on b
        ("torque", np.float64, (3,)),  # N·m about the point, on b: torsional and rolling friction
        ("gap", np.float64),  # m, negative in penetration
        ("friction", np.float64),  # coefficient µ
        ("friction_use", np.float64),  # |f_t| / (µ f_n) of the force: 1 where it slides, 0 without friction
        ("pull", np.float64, (3,)),  # N, of adhesion on b: `force` is the compression by it and all else
    ]
)
"""numpy type of one row of `Simulation.contacts`, world axes."""

BATCH_CONTACT = np.dtype([("member", np.int32), *((name, CONTACT[name]) for name in CONTACT.names or ())])
"""numpy type of one row of `Batch.contacts`: the member whose contact it is, then as `CONTACT`."""

RECORDED_CONTACT = np.dtype(
    [
        ("step", np.int64),
        *((name, CONTACT[name]) for name in CONTACT.names or () if name not in ("torque", "pull")),
    ]
)
"""numpy type of one row of `Recording.contacts`: the place of its step in `Recording.time`, then as `CONTACT`, without the
torque and the pull of adhesion, which recordings do not have."""


def with_members(contacts: npt.NDArray[Any], members: npt.NDArray[np.int32]) -> npt.NDArray[Any]:
    rows = np.empty(len(contacts), BATCH_CONTACT)
    rows["member"] = members
    for name in CONTACT.names or ():
        rows[name] = contacts[name]
    return rows
