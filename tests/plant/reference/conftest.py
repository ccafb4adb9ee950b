"""Prints the table of errors at the end, with the rows of all processes (pytest -n)."""

HEADINGS = ("scenario", "quantity", "reference", "plant", "error %", "limit %", "target %", "own error %", "")
LINE = "{:26} {:23} {:>11} {:>11} {:>9} {:>8} {:>8} {:>11} {}"


def pytest_terminal_summary(terminalreporter):
    reports = [report for outcome in ("passed", "failed") for report in terminalreporter.stats.get(outcome, [])]
    rows = [tuple(row) for report in reports for name, row in report.user_properties if name == "row"]
    if not rows:
        return
    terminalreporter.section("errors of the plant")
    terminalreporter.write_line(LINE.format(*HEADINGS).rstrip())
    for _, scenario, quantity, reference, plant, error, limit, target, own in sorted(rows, key=lambda row: row[0]):
        values = (f"{value:.5g}" for value in (reference, plant))
        errors = (f"{value:.2g}" if value < 99.5 else f"{value:.0f}" for value in (error, limit, target))
        note = "todo" if error > target else "meets its target: take `today` away" if limit > target else ""
        terminalreporter.write_line(LINE.format(scenario, quantity, *values, *errors, f"{own:.0e}", note).rstrip())
