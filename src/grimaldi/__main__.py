"""`python -m grimaldi` is the command `grimaldi`."""

from grimaldi.cli import main

main()
