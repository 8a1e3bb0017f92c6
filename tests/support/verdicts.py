"""Verdicts of physics, for libraries that no test has to walk."""

from gaitchain.gait.qualification import GateReport, Qualification

PASSED = Qualification(GateReport(True, 1, 1, 1, feedback=True))
FAILED = Qualification(GateReport(False, 1, 1, 0, feedback=True))
