"""Reads pbrt's scene files, of versions 3 and 4, as Mitsuba scenes; says what it leaves out."""

from grimaldi.scene.pbrt.reader import read

__all__ = ["read"]
