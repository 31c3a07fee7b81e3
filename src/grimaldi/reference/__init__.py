"""Closed forms, one a file, each with its source: what the models are held against.

Factors are M = U/U0, U0 being the undisturbed field at the receiver (THEORY eq. 1-2). Time dependence
e^{-iωt}; all lengths in one unit; a source at infinity (`source_distance=inf`) is a plane wave.
"""
