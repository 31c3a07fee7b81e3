"""The examples and the README's Python, run as a reader would: in a folder of their own."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.image import imread

ROOT = Path(__file__).parent.parent


def run(*arguments: str | Path, cwd: Path) -> str:
    """What Python prints for `arguments`, which it must end well on."""
    done = subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


def numbers(printed: str) -> list[float]:
    """The number that ends each line."""
    return [float(line.split()[-1]) for line in printed.splitlines()]


def test_young(tmp_path: Path) -> None:
    _, spacing, expected, contrast = numbers(run(ROOT / "examples/01_young.py", cwd=tmp_path))
    assert spacing == pytest.approx(expected, rel=2e-3)
    assert contrast < 1e-6


def test_shadow(tmp_path: Path) -> None:
    (brighter,) = numbers(run(ROOT / "examples/02_shadow.py", cwd=tmp_path))
    assert 1.2 < brighter < 2.5  # fringes overshoot, and where two rims meet they add
    waves, rays = (imread(tmp_path / f"shadow-{name}.png") for name in ("waves", "rays"))
    assert abs(waves - rays).max() > 0.2
    assert (tmp_path / "shadow-waves.exr").stat().st_size > 100_000


def test_aperture(tmp_path: Path) -> None:
    printed = run(ROOT / "examples/03_aperture.py", cwd=tmp_path)
    # angular spectrum of the same star, 4096² points on 6.4 mm: 1.72
    assert float(re.findall(r"axis\s+([\d.]+)", printed)[0]) == pytest.approx(1.72, abs=0.02)
    assert imread(tmp_path / "aperture.png").std() > 0.1


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL))
def test_readme(block: str, tmp_path: Path) -> None:
    printed = run("-c", block, cwd=tmp_path)
    pictures = re.findall(r'"([\w-]+\.(?:png|exr))"', block)
    assert pictures
    assert all((tmp_path / name).stat().st_size > 1000 for name in pictures)
    if "#" in block and "print" in block:
        said = re.findall(r"print\(.*?# \(1, 1, 2001\) ([\d.]+)", block)
        assert numbers(printed) == [pytest.approx(float(said[0]), abs=5e-3)]
