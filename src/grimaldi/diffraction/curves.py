"""What M loses where a curve's polygon stands for it (`Outline.detour`).

The polygon has the curve's own area: inside and outside in turn, its errors cancel to second order round a whole loop.
At the ends of an arc, where another body hides the rest, they do not.
"""

from __future__ import annotations

from grimaldi.outlines.model import Outline
from grimaldi.scene.model import Scene

SHARE = 0.05  # of the phase, or of its square: more than measured behind ellipses and balls of all sizes


def phase_allowed(scene: Scene, tolerance: float) -> float:
    """By how much kΔ may err along a polygon [rad] for M to err by a twentieth of the tolerance."""
    return tolerance**0.5 if scene.screen else tolerance


def curve_error(scene: Scene, outline: Outline, k: float) -> float:
    """|M| that an outline's polygons leave: of whole loops the square of the phase counts, of bodies the phase."""
    phase = k * outline.detour
    return SHARE * (phase**2 if scene.screen else phase)
