"""Points Dr.Jit at the libLLVM of this environment, at interpreter start.

Dr.Jit loads libLLVM once, when it is imported; so whoever imports Mitsuba before Grimaldi needs the
variable set before either. `grimaldi_libllvm.pth` imports this module whenever Python starts, hence: no
imports beyond what a starting interpreter holds anyway, and no exception may leave it.
"""

import os
import sys

VARIABLE = "DRJIT_LIBLLVM_PATH"
MINIMUM = 17  # older ones are refused by Dr.Jit (14) or abort the process in the middle of a kernel (15, 16)


def find() -> str | None:
    """Path of the newest `libLLVM.so.<version>` that karellen-llvm-core laid into this environment.

    The unversioned name is a link made only at the environment's next interpreter start. The wheel puts
    the library into the environment's lib/, which is three folders up from this file where that is
    installed (also with `pip install --user`), and sys.prefix/lib where it is not (editable).
    """
    found: list[tuple[tuple[int, ...], str]] = []
    installed = os.path.abspath(__file__)
    for _ in range(3):
        installed = os.path.dirname(installed)
    folders = {os.path.join(sys.prefix, "lib")}
    if os.path.basename(installed) == "lib":
        folders.add(installed)
    for folder in folders:
        try:
            names = os.listdir(folder)
        except OSError:
            continue
        for name in names:
            version = name.removeprefix("libLLVM.so.").split(".")
            if name.startswith("libLLVM.so.") and all(part.isdigit() for part in version):
                found.append((tuple(map(int, version)), os.path.join(folder, name)))
    version, path = max(found, default=((0,), None))
    return path if version[0] >= MINIMUM else None


def provide() -> None:
    """Set DRJIT_LIBLLVM_PATH unless the user has, or Dr.Jit is already loaded."""
    if sys.platform != "linux" or os.environ.get(VARIABLE) or "drjit" in sys.modules:
        return
    path = find()
    if path:
        os.environ[VARIABLE] = path


try:
    provide()
except Exception:  # a broken search must not break every Python of the environment
    pass
