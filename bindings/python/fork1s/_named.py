"""Numbers that go by name as well as by place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import UnknownNameError


class NamedValues(np.ndarray[Any, np.dtype[np.float64]]):
    """(n,) numbers by name or by place: `sim.joint_displacements["elbow"]`, `sim.joint_displacements[2]`.

    Parts of it, and what is computed from it, are plain arrays; copies and pickles keep the names, sort, roll and take,
    which change places, do not. Raises UnknownNameError (a KeyError).
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

    def copy(self, order: Any = "C") -> NamedValues:
        return by_name(np.array(self, order=order), self._names)

    def sort(self, *args: Any, **kwargs: Any) -> None:
        self._names = ()
        super().sort(*args, **kwargs)

    def partition(self, *args: Any, **kwargs: Any) -> None:
        self._names = ()
        super().partition(*args, **kwargs)

    def __copy__(self) -> NamedValues:
        return self.copy()

    def __deepcopy__(self, memo: Any) -> NamedValues:
        return self.copy()

    def __reduce__(self) -> Any:
        return by_name, (np.array(self), list(self._names))

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else np.asarray(array)


def by_name(array: npt.NDArray[np.float64], names: Sequence[str]) -> NamedValues:
    named = array.view(NamedValues)
    named._names = names
    return named
