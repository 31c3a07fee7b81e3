"""What the benchmarks share with `grimaldi bench`: the machine they ran on, and tables in markdown."""

from grimaldi.bench.report import facts as facts
from grimaldi.bench.report import machine as machine
from grimaldi.bench.report import table as table
