"""Scenes: loaded, checked, and read as plain geometry and sources in Float64."""

from grimaldi.scene.checking import require_sensor, require_sources
from grimaldi.scene.loading import load
from grimaldi.scene.model import Scene
from grimaldi.scene.planar import PlanarOutline
from grimaldi.scene.sources import sources

__all__ = ["PlanarOutline", "Scene", "load", "require_sensor", "require_sources", "sources"]
