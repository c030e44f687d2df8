"""Reports: results as text, JSON and HTML."""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.report.arm_report import write_report as write_report

public(__name__, {"arm_report": "write_report"}, called='pinsing.write_report(arm, "report.html")')
