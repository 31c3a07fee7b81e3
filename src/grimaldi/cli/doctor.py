"""`grimaldi doctor`."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from importlib import metadata
from pathlib import Path

import typer

from grimaldi.machine import processor


def doctor() -> None:
    """Say what is installed, what is wrong, and what mends it."""
    problems = list(_wrong_packages())
    _line("grimaldi", metadata.version("grimaldi"))
    _line("python", f"{platform.python_version()} ({sys.executable})")
    _line("system", f"{platform.system()} {platform.machine()}: {_support()}")
    _line("CPU", f"{processor()}, {os.cpu_count()} threads")
    if not problems:  # with the wrong packages, importing Mitsuba may well end the process
        problems += _back_ends()
    for problem in problems:
        _line("WRONG", problem)
    if problems:
        raise typer.Exit(1)
    print("Nothing is wrong.")


def _line(label: str, text: str) -> None:
    print(f"{label:9} {text}")


def _wrong_packages() -> list[str]:
    """Run-time requirements that are missing or of another version."""
    from packaging.requirements import Requirement

    wrong = []
    for text in metadata.requires("grimaldi") or []:
        requirement = Requirement(text)
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        try:
            version = metadata.version(requirement.name)
        except metadata.PackageNotFoundError:
            version = None
        if version is None or version not in requirement.specifier:
            mend = f"run '{sys.executable} -m pip install \"{requirement.name}{requirement.specifier}\"'"
            wrong.append(f"{requirement.name} is {version or 'missing'}, needs {requirement.specifier}: {mend}")
    return wrong


def _back_ends() -> list[str]:
    """Print what Mitsuba, libLLVM and the GPU are, and return what is wrong with them."""
    import drjit as dr
    import mitsuba as mi

    from grimaldi.variants import best_variant, libllvm_problem

    gpu = dr.has_backend(dr.JitBackend.CUDA)
    wrong = libllvm_problem()
    version = ".".join(map(str, dr.detail.llvm_version()))
    _line("mitsuba", f"{mi.__version__}, drjit {metadata.version('drjit')}")
    _line("libLLVM", "none that works" if wrong else f"{version} ({_loaded_libllvm()})")
    _line("GPU", f"CUDA {'.'.join(map(str, dr.detail.cuda_version()))}" if gpu else "none answers")
    if gpu or not wrong:
        _line("variant", f"{best_variant('rgb')} for render, {best_variant('mono')} for field")
    problems = [] if wrong is None else [wrong]
    if not gpu and shutil.which("nvidia-smi"):
        problems.append("nvidia-smi is here but CUDA does not answer: run 'nvidia-smi', and update the driver")
    return problems


def _support() -> str:
    """What is promised for this system."""
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return "supported"
    return (
        "untested; PyPI has no libLLVM for it: install LLVM 17 or newer by the system's package manager, "
        "and set DRJIT_LIBLLVM_PATH to its libLLVM"
    )


def _loaded_libllvm() -> str:
    """Path of the libLLVM in this process, as far as the system tells."""
    maps = Path("/proc/self/maps")
    if maps.exists():
        for line in maps.read_text().splitlines():
            path = line.split(maxsplit=5)[-1]
            if "libLLVM" in path:
                return path
    return os.environ.get("DRJIT_LIBLLVM_PATH", "found by Dr.Jit")
