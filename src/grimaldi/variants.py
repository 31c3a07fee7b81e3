"""Which Mitsuba variant to compute with, and whether its back end works here."""

from __future__ import annotations

import os
import platform
import sys
from typing import Any, Literal

import _grimaldi_libllvm as libllvm
from grimaldi.errors import InputError


def ensure_variant(kind: Literal["rgb", "mono"]) -> str:
    """The name of Mitsuba's variant, set to the best one of `kind` if none is set yet.

    On CUDA Dr.Jit's fast math is turned off.
    Raises InputError where waves cannot be computed in that variant, and where it needs a libLLVM and
    none works: older ones than 17 abort the process in the middle of a kernel.
    """
    import drjit as dr
    import mitsuba as mi

    name = mi.variant() or best_variant(kind)
    check_variant(name)
    if name.startswith("llvm"):
        problem = libllvm_problem()
        if problem is not None:
            raise InputError(problem)
    if mi.variant() is None:
        mi.set_variant(name)
    if on_cuda():
        dr.set_flag(dr.JitFlag.FastMath, False)  # with it CUDA's reciprocals and roots of Float64 have 20 bits
    return name


def check_variant(name: str) -> None:
    """Raise InputError unless waves can be computed in the variant: scalar, spectral and polarized ones cannot."""
    if name.startswith("scalar") or "spectral" in name or "polarized" in name:
        raise InputError(
            f"variant {name}: waves need an llvm or cuda variant in rgb or mono; use llvm_ad_rgb or llvm_ad_mono"
        )


def best_variant(kind: Literal["rgb", "mono"]) -> str:
    """The variant of `kind` that is fastest here: CUDA where a GPU answers, else LLVM."""
    import drjit as dr

    backend = "cuda" if dr.has_backend(dr.JitBackend.CUDA) else "llvm"
    return f"{backend}_ad_{kind}"


def on_cuda() -> bool:
    """Whether the variant in use computes on a GPU."""
    import mitsuba as mi

    return (mi.variant() or "").startswith("cuda")


def end_kernel(*values: Any) -> None:
    """On CUDA, compute Dr.Jit arrays now: a kernel of OptiX traces rays in one scene, and light's and camera's differ.

    Elsewhere nothing is done, so that one kernel holds both.
    """
    import drjit as dr

    if on_cuda():
        dr.eval(values)


def libllvm_problem() -> str | None:
    """What is wrong with the libLLVM that Dr.Jit has loaded, with its remedy, on one line, or None."""
    import drjit as dr

    version = dr.detail.llvm_version()
    if version >= (libllvm.MINIMUM,) and dr.has_backend(dr.JitBackend.LLVM):
        return None
    chosen = os.environ.get(libllvm.VARIABLE)
    if version[0] < 0:
        wrong = f"no usable libLLVM (Grimaldi needs LLVM {libllvm.MINIMUM} or newer)"
    else:
        wrong = f"libLLVM {'.'.join(map(str, version))} is too old (Grimaldi needs {libllvm.MINIMUM} or newer)"
    if chosen:
        wrong = f"{libllvm.VARIABLE}={chosen}: {wrong}"
    return f"{wrong}: {_remedy(chosen)}"


def _remedy(chosen: str | None) -> str:
    ours = libllvm.find()
    if ours is not None and chosen not in (None, "", ours):
        return f"run 'unset {libllvm.VARIABLE}'; then {ours} is used"
    if ours is not None:
        return f"import grimaldi before drjit or mitsuba, or run 'export {libllvm.VARIABLE}={ours}' first"
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return f"run '{sys.executable} -m pip install --force-reinstall karellen-llvm-core'"
    install = {
        "darwin": "run 'brew install llvm'",
        "win32": "install LLVM from its releases",
    }.get(sys.platform, f"install libLLVM {libllvm.MINIMUM} or newer by the system's package manager")
    return f"{install} and set {libllvm.VARIABLE} to its libLLVM (untested on this system)"
