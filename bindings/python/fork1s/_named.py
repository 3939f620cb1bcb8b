"""Numbers that go by name as well as by place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import UnknownNameError


class NamedValues(np.ndarray[Any, np.dtype[np.float64]]):
    """(n,) numbers by name or by place: `sim.joint_displacements["elbow"]`, `sim.joint_displacements[2]`.

    Parts of it, and what is computed from it, are plain arrays. Raises UnknownNameError (a KeyError).
    """

    _names: Sequence[str] = ()

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self._names:
                raise UnknownNameError(
                    f"there is no joint coordinate '{key}'; there are: {', '.join(self._names)}"
                )
            key = self._names.index(key)
        return self.view(np.ndarray)[key]

    def __array_finalize__(self, made_from: Any) -> None:
        names = getattr(made_from, "_names", ())
        self._names = names if self.shape == (len(names),) else ()

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else np.asarray(array)


def by_name(array: npt.NDArray[np.float64], names: Sequence[str]) -> NamedValues:
    named = array.view(NamedValues)
    named._names = names
    return named
