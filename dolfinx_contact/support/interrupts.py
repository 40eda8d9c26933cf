# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Ctrl-C that waits until what must not be left half done is done."""

from __future__ import annotations

import signal
from threading import current_thread, main_thread
from typing import Any


class uninterrupted:
    """Ctrl-C in the block is answered after it; in the main thread, which alone receives it."""

    def __enter__(self) -> None:
        self._came: tuple = ()
        self._handler: Any = signal.getsignal(signal.SIGINT)
        self._holds = current_thread() is main_thread() and callable(self._handler)
        if self._holds:
            signal.signal(signal.SIGINT, self._wait)

    def _wait(self, *came: Any) -> None:
        self._came = came

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if self._holds:
            signal.signal(signal.SIGINT, self._handler)
            if self._came and error is None:
                self._handler(*self._came)
