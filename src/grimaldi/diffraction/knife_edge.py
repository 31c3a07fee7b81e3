"""The straight edge in Fresnel's approximation, for Dr.Jit arrays (Born & Wolf §8.7.3)."""

from __future__ import annotations

from typing import Any

# The auxiliary functions f and g (Abramowitz & Stegun §7.3.5-6) as quotients of polynomials in v, lowest power
# first, with their values 1/2 at 0 and asymptotes 1/(πv) and 1/(π²v³) exact; the rest fitted: errors below 1.1e-5.
F_ABOVE = (1.0, 1.24922, 0.46902, 0.65267)
F_BELOW = (2.0, 2.50127, 4.01981, 1.47212, 2.05042)
G_ABOVE = (1.0, 0.23037, 0.27768)
G_BELOW = (2.0, 4.46318, 6.28213, 6.00595, 2.93616, 2.74059)


def _polynomial(v: Any, coefficients: tuple[float, ...]) -> Any:
    value = type(v)(0)
    for c in reversed(coefficients):
        value = value * v + c
    return value


def amplitude(v: Any) -> tuple[Any, Any]:
    """E(v), real and imaginary part: M = E(v) e^{iπv²/2} in the shadow of a half plane, v >= 0.

    v: Fresnel's parameter. On the lit side M = 1 - E(|v|) e^{iπv²/2}. E(0) = 1/2, |E| falls as 1/(√2 π v).
    """
    f = _polynomial(v, F_ABOVE) / _polynomial(v, F_BELOW)
    g = _polynomial(v, G_ABOVE) / _polynomial(v, G_BELOW)
    return 0.5 * (g + f), 0.5 * (f - g)
