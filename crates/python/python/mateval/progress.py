"""What long work says while it runs.

``lift``, ``procedural``, ``delight``, ``lint``, ``score`` and ``Scene.render`` take ``progress``: None shows a bar where
somebody sees it, in a terminal or a notebook; True always shows one on stderr; False shows none; a callable is called
with a name, what is done and how much there is, as in ``("room: light", 3, 10)``, at most twenty times a second.
Sentences that must not be lost go to the logger ``mateval``.
"""

from __future__ import annotations

import sys
from typing import Any, Callable, Optional, Protocol, Union

Progress = Union[None, bool, Callable[[str, int, int], object]]


class Listener(Protocol):
    """What the extension module calls, from the thread that made the call."""

    def __call__(self, name: str, done: int, total: int) -> object: ...

    def message(self, text: str) -> None: ...

    def close(self) -> None: ...


class _Callable:
    def __init__(self, call: Callable[[str, int, int], object]) -> None:
        self.call = call

    def __call__(self, name: str, done: int, total: int) -> object:
        return self.call(name, done, total)

    def message(self, text: str) -> None:
        import logging  # `import mateval` does without.

        logging.getLogger("mateval").warning(text)

    def close(self) -> None:
        pass


class _Bar(_Callable):
    """One line of a terminal, removed at the end."""

    def __init__(self) -> None:
        super().__init__(self.show)
        self.columns = 0

    def show(self, name: str, done: int, total: int) -> None:
        # 79 columns, so that the cursor stays in the line.
        line = bar(name, done, total)[:79]
        sys.stderr.write("\r" + line.ljust(self.columns))
        sys.stderr.flush()
        self.columns = len(line)

    def message(self, text: str) -> None:
        self.close()
        super().message(text)

    def close(self) -> None:
        if self.columns:
            sys.stderr.write("\r" + " " * self.columns + "\r")
            sys.stderr.flush()
            self.columns = 0


class _NotebookBar(_Callable):
    """A line below the cell, removed at the end."""

    def __init__(self, display: Any) -> None:
        super().__init__(self.show)
        self.display = display
        self.handle: Any = None

    def show(self, name: str, done: int, total: int) -> None:
        text = {"text/plain": bar(name, done, total)}
        if self.handle is None:
            self.handle = self.display(text, raw=True, display_id=True)
        else:
            self.handle.update(text, raw=True)

    def close(self) -> None:
        if self.handle is not None:
            self.handle.update({"text/plain": ""}, raw=True)


def bar(name: str, done: int, total: int) -> str:
    """A line of text: 24 places, the share, and the name."""
    filled = 24 * done // max(total, 1)
    return f"[{'#' * filled}{'.' * (24 - filled)}] {done}/{total} {name}"


def listener(progress: Progress) -> Optional[Listener]:
    """The listener that an argument ``progress`` stands for."""
    if progress is None or progress is True:
        # Whoever runs in a notebook has imported it.
        ipython = sys.modules.get("IPython")
        shell = ipython.get_ipython() if ipython is not None else None
        if shell is not None and "IPKernelApp" in shell.config:
            from IPython.display import display

            return _NotebookBar(display)
        return _Bar() if progress or sys.stderr.isatty() else None
    if progress is False:
        return None
    if not callable(progress):
        raise TypeError(f"progress: expected None, True, False or a callable, found {progress!r}")
    return _Callable(progress)
