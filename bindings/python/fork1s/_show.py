"""The live page, in a tab of the browser or a cell of a notebook."""

from __future__ import annotations

import atexit
import html
import os
import sys
import webbrowser
from pathlib import Path
from typing import Any

from . import _core
from ._errors import FileError, UsageError

_open: set[Page] = set()


class Page:
    """A live page that goes on until it is closed: a copy of a simulation in real time, to watch and to touch.

    In a notebook the cell shows it. `with fork1s.show(sim) as page:` closes it at the end.
    """

    def __init__(self, page: _core.LivePage, height: int) -> None:
        self._page = page
        self._height = height
        _open.add(self)

    @property
    def address(self) -> str:
        """Where it is, on this machine only, with the token that requests need."""
        return self._page.address

    @property
    def closed(self) -> bool:
        return self._page.closed

    @property
    def viewers(self) -> int:
        """Browsers that look at it now."""
        return self._page.viewers

    def close(self) -> None:
        """Ends it. Twice is as good as once."""
        self._page.close()
        _open.discard(self)

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{self.address}" width="100%" height="{self._height}" style="border:0" '
            'title="fork1s"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<fork1s.Page {'closed' if self.closed else 'at ' + self.address}>"


class Replay:
    """A recording as one page that plays it, with everything in it. A notebook shows it in its cell."""

    def __init__(self, page: str, height: int) -> None:
        self.page = page
        self._height = height

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the page to a file, which any browser opens from a disk."""
        try:
            Path(path).write_text(self.page, encoding="utf-8")
        except OSError as error:
            raise FileError(f"{os.fspath(path)}: {error.strerror}") from error

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.page, quote=True)}" width="100%" height="{self._height}" '
            'style="border:0" title="fork1s"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<fork1s.Replay of {len(self.page) / 1e6:.1f} MB>"


def replay(path: str | os.PathLike[str], *, height: int = 480) -> Replay:
    """A recording, of `Simulation.record` or of `fork1s run --record`, as a page that plays it.

    Args:
        height: of a notebook's cell, pixels.

    Raises:
        FileError: it cannot be read, or the package was built without its page. FormatError: it is damaged.
    """
    return Replay(_core.replay_page(os.fspath(path)), height)


def replay_of(sim: _core.Simulation, height: int) -> Replay:
    private: Any = sim
    path = private._flush_recording()
    if not path:
        raise UsageError("replay: nothing was recorded; call record(path) before the first step")
    return replay(path, height=height)


@atexit.register
def _close_all() -> None:
    for page in list(_open):
        page.close()


def _in_notebook() -> bool:
    return "ipykernel" in sys.modules


def show(
    what: _core.Simulation | _core.Model, *, port: int = 0, height: int = 480, open_tab: bool = True
) -> Page:
    """Shows a simulation, or a model from its start, on a live page.

    The page goes on by itself from the state that `what` has now: whoever drags a body there moves the copy, and `what`
    stays as it is.

    Args:
        port: on 127.0.0.1; 0 takes any that is free.
        height: of a notebook's cell, pixels.
        open_tab: opens a tab of the browser where there is a display and no notebook.

    Raises:
        FileError: the package was built without its page. ModelError: the port is taken.
    """
    if isinstance(what, _core.Model):
        what = _core.Simulation(what)
    page = Page(_core.show(what, port), height)
    if open_tab and not _in_notebook() and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(page._page.launch())  # a command line with the token would be readable by all users
    return page
