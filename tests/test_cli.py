"""The command as a process: what it writes, how it exits, and the line it says when the input is wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import grimaldi
from grimaldi.files import replacing

SCENE = """
<scene version="3.0.0">
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0, 0, 0" target="0, 0, 10" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/></film>
    </sensor>
    <emitter type="coherent_point"><point name="position" x="-2" y="0" z="0"/></emitter>
    <emitter type="coherent_point"><point name="position" x="2" y="0" z="0"/></emitter>
    <shape type="rectangle">
        <transform name="to_world">
            <scale value="20"/><lookat origin="0, 0, 10" target="0, 0, 0" up="0, 1, 0"/>
        </transform>
    </shape>
</scene>
"""
FAR = """
<scene version="3.0.0">
    <emitter type="point" id="lamp"><point name="position" x="1e20" y="0" z="0"/></emitter>
    <shape type="sphere"/>
</scene>
"""
PLANE = "-3,-3,9; 3,-3,9; -3,3,9; 4x3"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "young.xml"
    path.write_text(SCENE)
    return path


def command(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "grimaldi", *map(str, arguments)], capture_output=True, text=True, cwd=cwd
    )


def said(done: subprocess.CompletedProcess[str]) -> str:
    """The one line that a command with wrong input says."""
    assert done.returncode == 2, done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("grimaldi: ")
    assert done.stdout == ""
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["render", "young", "-o", "x.png", "--wavelenth", "0.4"], "--wavelength"),
        (["rendr", "young"], "render"),
        (["render", "young"], "--output"),
        (["render", "-o", "x.png"], "scene"),
        (["render", "young", "-o", "x.jpg"], "x.jpg: unknown kind of picture '.jpg'"),
        (["render", "young", "-o", "nowhere/x.png"], "the folder nowhere does not exist"),
        (["render", "young", "-o", "x.png", "--size", "20by30"], "--size: '20by30'"),
        (["render", "young", "-o", "x.png", "--size", "0x30"], "--size: '0x30'"),
        (["render", "young", "-o", "x.png", "--spp", "many"], "--spp"),
        (["render", "young", "-o", "x.png", "--diffraction", "boundry"], "boundary"),
        (["render", "young", "-o", "x.png", "--smooth", "7"], "smooth: 7 is no number of levels"),
        (["field", "young", "-o", "x.nc", "--plane", PLANE, "--smooth", "7"], "smooth: 7 is no number of levels"),
        (["outline", "young", "-o", "x.svg", "--smooth", "-1"], "smooth: -1 is no number of levels"),
        (["render", "young", "-o", "x.png", "--variant", "llvm_rgb"], "did you mean 'llvm_ad_rgb'"),
        (["render", "young", "-o", "x.png", "--variant", "scalar_rgb"], "variant scalar_rgb: waves need"),
        (["render", "young", "-o", "x.png", "--variant", "llvm_ad_spectral"], "variant llvm_ad_spectral: waves need"),
        (["outline", "arago", "-o", "x.svg", "--variant", "scalar_rgb"], "variant scalar_rgb: waves need"),
        (["field", "arago", "-o", "x.npz", "--plane", PLANE, "--wavelength", "1e-320"], "wavelength: '1e-320'"),
        (["field", "far.xml", "-o", "x.npz", "--plane", PLANE, "--wavelength", "1"], "far.xml: lamp: position is too"),
        (["field", "arago", "-o", "x.npz", "--plane", PLANE, "--occlusion", "some"], "graded"),
        (["field", "arago", "-o", "x.npz", "--plane", PLANE, "--rim", "round"], "smooth"),
        (["field", "young", "-o", "x.npz"], "--points"),
        (["field", "young", "-o", "x.npz", "--points", "p.npy", "--plane", PLANE], "--points"),
        (["field", "young", "-o", "x.npz", "--points", "missing.npy"], "missing.npy: cannot be read"),
        (["field", "young", "-o", "x.npz", "--points", "p.txt"], "p.txt: unknown kind of file"),
        (["field", "young", "-o", "x.npz", "--points", "words.csv"], "words.csv: not a table of numbers"),
        (["field", "young", "-o", "x.npz", "--points", "two.csv"], "two.csv: has the shape (1, 2)"),
        (["field", "young", "-o", "x.npz", "--points", "empty.csv"], "empty.csv: has the shape (0, 3)"),
        (["field", "young", "-o", "x.npz", "--points", "nan.csv"], "nan.csv: row 2 is not finite"),
        (["field", "young", "-o", "x.npz", "--points", "words.npy"], "words.npy: not a table of numbers"),
        (["field", "young", "-o", "x.npz", "--points", "complex.npy"], "complex.npy: not real numbers"),
        (["field", "young", "-o", "x.npz", "--plane", "0,0,0; 1,0,0; 0,1,0"], "--plane: cannot read"),
        (["field", "young", "-o", "x.npz", "--plane", "0,0; 1,0; 0,1; 2x2"], "--plane: cannot read"),
        (["field", "young", "-o", "x.npz", "--plane", "0,0,0; 1,0,0; 0,nan,0; 2x2"], "--plane: cannot read"),
        (["field", "young", "-o", "x.npz", "--plane", "0,0,0; 1,0,0; 0,1,0; 0x2"], "--plane: cannot read"),
        (["field", "young", "-o", "x.npz", "--plane", "0,0,0; 1,0,0; 3,0,0; 2x2"], "lie in one line"),
        (["field", "young", "-o", "x.dat", "--plane", PLANE], "x.dat: unknown kind of file"),
        (["field", "young", "-o", "folder.nc", "--plane", PLANE], "folder.nc: is a folder"),
        (["field", "young", "-o", "words.zarr", "--plane", PLANE], "words.zarr: is a file"),
        (["outline", "young", "-o", "x.pdf"], "x.pdf: unknown kind of file"),
    ],
)
def test_wrong_usage_is_one_line_and_writes_nothing(tmp_path: Path, arguments: list[str], named: str) -> None:
    (tmp_path / "words.csv").write_text("x,y,z\n1,2,three\n")
    (tmp_path / "far.xml").write_text(FAR)
    (tmp_path / "words.zarr").write_text("not a folder")
    (tmp_path / "folder.nc").mkdir()
    (tmp_path / "two.csv").write_text("1,2\n")
    (tmp_path / "empty.csv").write_text("x, y, z\n")
    (tmp_path / "nan.csv").write_text("1,2,3\n4,nan,6\n")
    (tmp_path / "words.npy").write_text("not an array")
    np.save(tmp_path / "complex.npy", [[1j, 0, 0]])
    before = sorted(tmp_path.iterdir())
    assert named in said(command(*arguments, cwd=tmp_path))
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_that_cannot_be_written_to_is_found_first(tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o500)
    if os.access(folder, os.W_OK):
        folder = Path("/proc/self")  # no user, root neither, writes there
    if os.access(folder, os.W_OK):
        pytest.skip("every folder is writable here")
    assert f"the folder {folder} is not writable" in said(command("render", "missing", "-o", folder / "x.png"))


def test_help_and_version() -> None:
    asked = command("--help")
    assert asked.returncode == 0
    assert all(name in asked.stdout for name in ("render", "field", "outline", "doctor"))
    assert command("--version").stdout.strip() == f"grimaldi {grimaldi.__version__}"


def test_doctor_finds_nothing_wrong_where_the_tests_run() -> None:
    found = command("doctor")
    assert found.returncode == 0, found.stdout
    assert "libLLVM" in found.stdout
    assert found.stdout.endswith("Nothing is wrong.\n")


@pytest.mark.skipif(sys.platform != "linux", reason="where libLLVM lies is known for Linux only")
def test_without_libllvm_the_remedy_is_named(tmp_path: Path, scene: Path) -> None:
    bad = os.environ | {"DRJIT_LIBLLVM_PATH": "/nonexistent/libLLVM.so", "CUDA_VISIBLE_DEVICES": ""}
    for arguments in (["doctor"], ["render", scene, "--wavelength", "0.5", "-o", tmp_path / "x.png"]):
        done = subprocess.run(
            [sys.executable, "-m", "grimaldi", *map(str, arguments)], capture_output=True, text=True, env=bad
        )
        assert done.returncode in (1, 2)
        assert "unset DRJIT_LIBLLVM_PATH" in done.stdout + done.stderr.splitlines()[-1]
        assert "Traceback" not in done.stderr


def test_a_link_stays_and_a_name_may_be_long(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link, long = tmp_path / "link.npz", tmp_path / f"{245 * 'x'}.npz"
    link.symlink_to(tmp_path / "there" / "real.npz")
    for path in (link, long):
        with replacing(path) as temporary:
            temporary.write_text("done")
        assert path.read_text() == "done"
    assert link.is_symlink()
    assert len(list(tmp_path.rglob("*"))) == 4


def test_field_files_hold_what_the_library_returns(tmp_path: Path, scene: Path) -> None:
    x, y = np.meshgrid(np.linspace(-3, 3, 4), np.linspace(-3, 3, 3))
    points = np.stack([x, y, np.full_like(x, 9.0)], axis=-1).reshape(-1, 3)
    np.save(tmp_path / "points.npy", points)
    np.savetxt(tmp_path / "points.csv", points, delimiter=",", header="x, y, z", comments="\ufeff", encoding="utf-8")
    expected = grimaldi.field(str(scene), points, wavelength="500 nm", scene_unit="1 um")

    unit = ["--wavelength", "500 nm", "--scene-unit", "1 um"]
    for name, where in {
        "out.nc": ["--points", tmp_path / "points.npy"],
        "out.zarr": ["--points", tmp_path / "points.csv"],
        "out.npz": ["--plane", PLANE],
    }.items():
        done = command("field", scene, *unit, *where, "-o", tmp_path / name)
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""

    for name in ("out.nc", "out.zarr"):
        with xr.open_dataset(tmp_path / name) as read:
            assert read["U"].dtype == np.complex128
            xr.testing.assert_equal(read, expected)
    with np.load(tmp_path / "out.npz") as read:
        np.testing.assert_array_equal(read["U"], expected["U"])
        assert json.loads(str(read["attrs"]))["grid"] == [3, 4]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_render_writes_every_output_of_one_computation(tmp_path: Path, scene: Path) -> None:
    outputs = [tmp_path / "out.exr", tmp_path / "out.png"]
    done = command(
        *("render", scene, "--wavelength", "0.5", "--size", "16x12", "--spp", "2", "--seed", "3"),
        *(argument for path in outputs for argument in ("-o", path)),
    )
    assert done.returncode == 0, done.stderr
    assert all(path.stat().st_size > 0 for path in outputs)


def test_outline_needs_the_source_named_among_several(tmp_path: Path, scene: Path) -> None:
    assert "name one of coherent_point, " in said(command("outline", scene, "-o", tmp_path / "out.svg"))
    assert "no source 'lamp'" in said(command("outline", scene, "--source", "lamp", "-o", tmp_path / "out.svg"))


def test_a_scene_without_wavelength_says_one(tmp_path: Path, scene: Path) -> None:
    assert "wavelength" in said(command("render", scene, "-o", tmp_path / "out.png"))


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to send to another process")
def test_ctrl_c_ends_with_one_line_and_no_file(tmp_path: Path, scene: Path) -> None:
    before = sorted(tmp_path.iterdir())
    long = ["--wavelength", "0.5", "--size", "2000x2000", "--spp", "100000", "-o", str(tmp_path / "out.exr")]
    running = subprocess.Popen(
        [sys.executable, "-m", "grimaldi", "render", str(scene), *long], stderr=subprocess.PIPE, text=True
    )
    time.sleep(5)  # well into the rendering
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=60)
    assert (running.returncode, errors) == (130, "grimaldi: interrupted\n")
    assert sorted(tmp_path.iterdir()) == before


def test_a_picture_loads_no_library_that_it_does_not_need(tmp_path: Path) -> None:
    """Each takes as long to import as the picture to compute."""
    heavy = [
        "finufft",
        "matplotlib",
        "pandas",
        "pint",
        "scipy.spatial",
        "scipy.special",
        "shapely",
        "trimesh",
        "xarray",
    ]
    arguments = ["render", "young", "--size", "8x8", "--spp", "1", "-o", str(tmp_path / "x.png")]
    script = (
        f"import sys\nfrom grimaldi.cli import run\nassert run({arguments}) == 0\n"
        f"print([name for name in {heavy} if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_what_cannot_be_said_ends_with_one_line():
    """What is printed last is still in a buffer then."""
    with Path("/dev/full").open("w") as full:
        words = [sys.executable, "-m", "grimaldi", "bench", "--list"]
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1
    assert done.stderr == "grimaldi: [Errno 28] No space left on device\n"
