"""The option of the offline tools that leaves the report out."""

from __future__ import annotations

import click

report_option = click.option('--report/--no-report', default=True, show_default=True,
                             help='draw report.html')
