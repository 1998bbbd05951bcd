"""A process sheet as one HTML page, which prints on A4."""

import html
from pathlib import Path

from selfmotion.basics import PlanError, ProblemError, as_path, shown, write_text
from selfmotion.margins import Margins
from selfmotion.result import Plan
from selfmotion.sheet.sections import Section, sections

_STYLE = """
@page { size: A4; margin: 14mm }
body { font: 10pt/1.35 system-ui, sans-serif; color: #222; max-width: 182mm; margin: 8mm auto }
h1 { font-size: 15pt; margin: 0 0 2mm } h2 { font-size: 11pt; margin: 4mm 0 1mm }
table { border-collapse: collapse; width: 100% }
td, th { text-align: left; vertical-align: top; padding: .4mm 3mm .4mm 0 }
td { border-top: .2mm solid #ccc }
th { font-weight: 600 } p { margin: 1mm 0 } .note { color: #555; font-size: 9pt }
.verified { color: #00695c; font-weight: 600 } .refused { color: #b71c1c; font-weight: 600 }
section { break-inside: avoid }
@media print { body { margin: 0; max-width: none } }
"""


def write_sheet(
    plan: Plan, file: str | Path, margins: Margins | None = None, *, title: str = ""
) -> Path:
    """Write what a program does, keeps and survives as one HTML page that prints on A4.

    The page needs no network and no other file. Every number is from the plan's certificate or
    report, or from the margins.

    Parameters
    ----------
    plan : Plan
    file : path
        Ends in ``.html``.
    margins : Margins, optional
        Of this plan (`selfmotion.margin`).
    title : str
        By default the arm's name and task.

    Raises
    ------
    PlanError
        The certificate is of another motion, or the margins are of another arm.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"write_sheet: plan is {shown(plan)}, expected a Plan")
    if not isinstance(margins, Margins | None):
        raise ProblemError(f"write_sheet: margins are {shown(margins)}, expected Margins")
    if not plan.certificate.motion:
        raise PlanError(f"{plan.robot.name}: {plan.certificate.verdict}")
    if margins is not None and margins.robot != plan.robot.name:
        raise PlanError(f"the margins are of {margins.robot}, the plan is of {plan.robot.name}")
    path = as_path(file)
    if path.suffix != ".html":
        raise ProblemError(f"{path}: expected a name that ends in .html")
    named = title or f"{plan.robot.name}, task {plan.task.value}"
    check = plan.certificate
    kind = "verified" if check.verified else "refused"
    body = [f"<h1>{html.escape(named)}</h1>", f'<p class="{kind}">{html.escape(check.verdict)}</p>']
    if margins is not None:
        body.append(f"<p>{html.escape(margins.sentence)}</p>")
    body += [_drawn(section) for section in sections(plan, margins)]
    write_text(
        path,
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{html.escape(named)}</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>\n",
    )
    return path


def _drawn(section: Section) -> str:
    head = ""
    if any(section.head):
        head = f"<tr>{''.join(f'<th>{html.escape(name)}</th>' for name in section.head)}</tr>"
    rows = "".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>"
        for row in section.rows
    )
    note = f'<p class="note">{html.escape(section.note)}</p>' if section.note else ""
    title = html.escape(section.title)
    return f"<section><h2>{title}</h2><table>{head}{rows}</table>{note}</section>"
