"""What an installation promises: libLLVM from its own environment, plugins by mere import, a quick start."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import _grimaldi_libllvm

PLUGINS = {
    "coherent_point": "'position': [0., 0., 1.]",
    "coherent_directional": "'direction': [0., 0., 1.]",
    "aperture": "",
    "wave": "'wavelength': 0.5",
}


def python(code: str, **environment: str) -> str:
    """What a fresh interpreter prints."""
    inherited = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=inherited | environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="PyPI has no libLLVM for this system"
)
@pytest.mark.parametrize(
    "imports", ["import mitsuba", "import mitsuba, grimaldi", "import grimaldi, mitsuba", "import drjit"]
)
def test_the_loaded_libllvm_is_the_installed_wheels(imports: str) -> None:
    loaded = python(f"{imports}\nprint(open('/proc/self/maps').read())")
    paths = {Path(line.split(maxsplit=5)[-1]) for line in loaded.splitlines() if "libLLVM" in line}
    wheel = metadata.distribution("karellen-llvm-core")
    shipped = [Path(str(wheel.locate_file(name))).resolve() for name in wheel.files or []]
    assert len(paths) == 1
    assert paths.pop().resolve() in shipped


def test_a_path_that_the_user_chose_stays() -> None:
    code = "import grimaldi, os; print(os.environ['DRJIT_LIBLLVM_PATH'])"
    assert python(code, DRJIT_LIBLLVM_PATH="/chosen/libLLVM.so").strip() == "/chosen/libLLVM.so"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["libLLVM.so.17.1", "libLLVM.so.9", "libLLVM.so", "libLLVM-19.so"], "libLLVM.so.17.1"),
        (["libLLVM.so.18.1", "libLLVM.so.20.1", "libLLVM.so.20.1.old"], "libLLVM.so.20.1"),
        (["libLLVM.so.16.0"], None),
        ([], None),
    ],
)
def test_the_newest_library_that_works_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: list[str], expected: str | None
) -> None:
    (tmp_path / "lib").mkdir()
    for name in names:
        (tmp_path / "lib" / name).touch()
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(_grimaldi_libllvm, "__file__", str(tmp_path / "src" / "_grimaldi_libllvm.py"))
    assert _grimaldi_libllvm.find() == (expected and str(tmp_path / "lib" / expected))


@pytest.mark.parametrize("imports", ["import mitsuba as mi, grimaldi", "import grimaldi, mitsuba as mi"])
def test_importing_grimaldi_registers_every_plugin_for_every_variant(imports: str) -> None:
    python(f"""
{imports}
for name in mi.variants():
    try:
        mi.set_variant(name)
    except ImportError:
        continue
    {"; ".join(f"mi.load_dict({{'type': '{name}', {more}}})" for name, more in PLUGINS.items())}
""")


def test_looking_for_mitsuba_is_not_importing_it() -> None:
    python("""
import grimaldi, importlib.util, sys
assert importlib.util.find_spec("mitsuba") is not None and "mitsuba" not in sys.modules
import mitsuba as mi
mi.set_variant("scalar_rgb")
mi.load_dict({"type": "aperture"})
""")


def test_hooks_on_the_same_module_all_run_once_and_leave_no_trace() -> None:
    python("""
import sys
from grimaldi._import_hook import after_import
finders = list(sys.meta_path)
called = []
after_import("colorsys", lambda: called.append("first"))
after_import("colorsys", lambda: called.append("second"))
import colorsys
assert sorted(called) == ["first", "second"] and sys.meta_path == finders
assert colorsys.__spec__.loader is colorsys.__loader__
assert type(colorsys.__loader__).__name__ == "SourceFileLoader"
""")


def test_public_names_are_there_and_others_are_not() -> None:
    python("""
import grimaldi, grimaldi.outlines, grimaldi.scene
assert all(callable(getattr(grimaldi, name)) for name in grimaldi.__all__)
assert set(grimaldi.__all__) <= set(dir(grimaldi))
assert not hasattr(grimaldi, "feild")
""")


@pytest.mark.parametrize("argument", ["--help", "--version"])
def test_help_imports_nothing_heavy(argument: str) -> None:
    heavy = {"mitsuba", "drjit", "numpy", "scipy", "xarray", "matplotlib", "shapely", "trimesh", "pint"}
    printed = python(f"""
import sys
from grimaldi.cli import run
assert run(["{argument}"]) == 0
print("loaded:", *{heavy!r} & set(sys.modules))
""")
    assert printed.splitlines()[-1].split() == ["loaded:"]
