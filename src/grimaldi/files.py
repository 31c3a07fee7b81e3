"""Writing files so that nothing half-written is ever left behind."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from grimaldi.errors import InputError

SCRATCH = ".grimaldi-"  # names of what is not done yet begin so


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name beside `path`, with its suffix, that becomes `path`, or what that links to, when all went well.

    The temporary file is removed when the block raises. Raises InputError where the folder of `path`
    is missing or cannot be written to.
    """
    path = Path(path)
    path = path.resolve() if path.is_symlink() else path
    check_writable(path)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=SCRATCH, suffix=path.suffix)
    except OSError as error:
        raise InputError(f"{path}: cannot write there ({error.strerror}); choose another folder") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: str | Path) -> Iterator[Path]:
    """Like `replacing`, for output that is a folder: a new one that takes the place of an older one."""
    path = Path(path)
    check_writable(path, folder=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=SCRATCH) as scratch:
        new, old = Path(scratch, "new"), Path(scratch, "old")
        new.mkdir()
        yield new
        if path.exists():
            path.rename(old)
        new.rename(path)


def check_writable(path: str | Path, *, folder: bool = False) -> None:
    """Raise InputError where no file, or no folder, can be put at `path`."""
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: the folder {path.parent} is not writable; choose another")
    if path.is_dir() and not folder:
        raise InputError(f"{path}: is a folder; name a file in it")
    if path.exists() and folder and not path.is_dir():
        raise InputError(f"{path}: is a file; remove it, or choose another name")


def _umask() -> int:
    """The process's umask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
