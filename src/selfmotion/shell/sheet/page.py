"""A process sheet as one HTML page, which prints on A4: for a plan or a program."""

import datetime
import html
from collections.abc import Iterator, Mapping
from pathlib import Path

from selfmotion.basics import PlanError, ProblemError, as_path, shown, write_text
from selfmotion.planning.result import Plan
from selfmotion.shell.replay import picture, seam_color
from selfmotion.shell.sheet.tables import Section, plan_sections, program_sections
from selfmotion.work.job import Program
from selfmotion.work.margins import Margins

_STYLE = """
@page { size: A4; margin: 14mm }
body { font: 10pt/1.35 system-ui, sans-serif; color: #222; max-width: 182mm; margin: 8mm auto;
  padding: 0 4mm; overflow-wrap: break-word }
h1 { font-size: 15pt; margin: 0 0 2mm } h2 { font-size: 11pt; margin: 4mm 0 1mm }
table { border-collapse: collapse; width: 100% }
td, th { text-align: left; vertical-align: top; padding: .4mm 3mm .4mm 0 }
td { border-top: .2mm solid #ccc }
td:first-child:not(:last-child) { min-width: 18mm } .whole { white-space: nowrap }
th { font-weight: 600 } p { margin: 1mm 0 } .note { color: #555; font-size: 9pt }
.verified { color: #00695c; font-weight: 600 } .refused { color: #b71c1c; font-weight: 600 }
section { break-inside: avoid } td.numbered { border-left: 1.2mm solid; padding-left: 2mm }
figure { margin: 2mm 0; break-inside: avoid } figure svg { width: 100%; max-height: 90mm }
.release td { padding-top: 14mm; border-top: 0; color: #555; font-size: 9pt }
.release span { display: block; border-top: .2mm solid #222; padding-top: 1mm }
@media screen and (max-width: 40em) {
  body { font-size: 9pt; padding: 0 3mm; margin: 3mm auto }
  section { overflow-x: auto } td, th { padding-right: 2mm }
  td:first-child:not(:last-child) { min-width: 12mm }
}
@media print { body { margin: 0; padding: 0; max-width: none } }
"""


def write_sheet(
    planned: Plan | Program,
    file: str | Path,
    margins: Margins | Mapping[str, Margins] | None = None,
    *,
    title: str = "",
    part_number: str = "",
    order_number: str = "",
    date: datetime.date | None = None,
) -> Path:
    """Write what a program does, keeps and survives as one HTML page that prints on A4.

    The page has a picture of arm, path and obstacles, and room to sign. It needs no
    network and no other file. Every number is from certificates, reports or margins.

    Parameters
    ----------
    made : Plan or Program
        Of a program: its seams with their feeds, its events and its moves.
    file : path
        Ends in ``.html``.
    margins : Margins, or mapping of str to Margins, optional
        Of this plan (`selfmotion.margin`); of a program by the names of its seams.
    title : str
        By default the arm's name and task, or how many seams there are.
    part_number, order_number : str
        Printed above the tables; left out by default.
    date : date, optional
        Of the sheet; today by default.

    Raises
    ------
    PlanError
        The certificate is of another motion, the margins are of another motion or problem, or the
        program has no seam of that name.
    ProblemError
        An argument is of another type, or the file's name does not end in ``.html``.
    """
    if not isinstance(planned, Plan | Program):
        raise ProblemError(f"write_sheet: {shown(planned)}, expected a Plan or a Program")
    day = datetime.date.today() if date is None else date
    if not isinstance(day, datetime.date):
        raise ProblemError(f"write_sheet: date is {shown(date)}, expected a datetime.date")
    path = as_path(file)
    if path.suffix != ".html":
        raise ProblemError(f"{path}: expected a name that ends in .html")
    if isinstance(planned, Plan):
        named, verified, verdict, sections = _of_plan(planned, margins)
    else:
        named, verified, verdict, sections = _of_program(planned, margins)
    named = title or named
    labels = {"part": part_number, "order": order_number, "date": day.isoformat()}
    about = " · ".join(f"{label} {text}" for label, text in labels.items() if text)
    kind = "verified" if verified else "refused"
    body = [f"<h1>{html.escape(named)}</h1>", f'<p class="note">{html.escape(about)}</p>']
    body += [f'<p class="{kind}">{html.escape(verdict)}</p>']
    body += [f"<p>{html.escape(each)}</p>" for each in _sentences(margins)]
    body += [_picture(planned), *(_drawn(section) for section in sections), _RELEASE]
    write_text(
        path,
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(named)}</title><style>{_STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>\n",
    )
    return path


# Title, whether it is verified, verdict, and tables.
_Contents = tuple[str, bool, str, tuple[Section, ...]]


def _of_plan(plan: Plan, margins: Margins | Mapping[str, Margins] | None) -> _Contents:
    if not isinstance(margins, Margins | None):
        raise ProblemError(f"write_sheet: margins are {shown(margins)}, expected Margins")
    _check_margins(plan, margins)
    check = plan.certificate
    named = f"{plan.robot.name}, task {plan.task.value}"
    return named, check.verified, check.verdict, plan_sections(plan, margins)


def _of_program(program: Program, margins: Margins | Mapping[str, Margins] | None) -> _Contents:
    known = {} if margins is None else margins
    if not isinstance(known, Mapping):
        raise ProblemError(
            f"write_sheet: margins are {shown(margins)}, expected those of each seam by its name"
        )
    for name, each in known.items():
        if name not in program.plans:
            seams = ", ".join(program.order)
            raise PlanError(
                f"write_sheet: margins are of seam {shown(name)}, expected one of: {seams}"
            )
        if not isinstance(each, Margins):
            raise ProblemError(
                f"write_sheet: margins of '{name}' are {shown(each)}, expected Margins"
            )
    for name, plan in program.plans.items():
        _check_margins(plan, known.get(name))
    named = f"{program.robot.name}, {program.extent}"
    return named, program.verified, program.verdict, program_sections(program, known)


def _check_margins(plan: Plan, margins: Margins | None) -> None:
    """Refuse certificates and margins of another motion."""
    if not plan.certificate.motion:
        raise PlanError(f"{plan.robot.name}: {plan.certificate.verdict}")
    if margins is not None and margins.robot != plan.robot.name:
        raise PlanError(f"the margins are of {margins.robot}, the plan is of {plan.robot.name}")
    own = plan.trajectory.digest, plan.problem.digest
    if margins is not None and (margins.motion, margins.problem) != own:
        raise PlanError(
            f"{plan.robot.name}: the margins are of another motion or problem than the plan; find "
            f"them anew (selfmotion.margin(plan))"
        )


def _sentences(margins: Margins | Mapping[str, Margins] | None) -> Iterator[str]:
    if isinstance(margins, Margins):
        yield margins.sentence
    elif margins is not None:
        yield from (f"Seam '{name}': {each.sentence}" for name, each in margins.items())


# Texts of so few letters are written in one line.
_SHORT, _WHOLE = 9, ' class="whole"'
# Where the sheet is signed.
_RELEASE = (
    "<section><h2>Release</h2><table class='release'><tr>"
    + "".join(
        f"<td><span>{label}</span></td>"
        for label in ("planned by", "released by", "date", "signature")
    )
    + "</tr></table></section>"
)


def _picture(planned: Plan | Program) -> str:
    """Return the picture of a motion; nothing where moves are missing."""
    if isinstance(planned, Plan):
        return _figure(picture(planned.robot, planned.trajectory, planned.obstacles))
    if not planned.steps or any(step.is_missing for step in planned.steps):
        return ""
    seams = list[tuple[float, float, str]]()
    for begin, step in zip(planned.begins, planned.steps, strict=True):
        if step.is_seam:
            seams.append((begin, begin + step.duration, seam_color(len(seams))))
    return _figure(picture(planned.robot, planned.trajectory, planned.obstacles, seams))


def _figure(drawing: str) -> str:
    told = "The arm at the begin, in the middle and at the end, and the tool's path"
    return f"<figure>{drawing}<figcaption class='note'>{told}.</figcaption></figure>"


def _drawn(section: Section) -> str:
    head = ""
    if any(section.head):
        head = f"<tr>{''.join(f'<th>{html.escape(name)}</th>' for name in section.head)}</tr>"
    colors = section.colors or ("",) * len(section.rows)
    rows = "".join(_row(row, color) for row, color in zip(section.rows, colors, strict=True))
    note = f'<p class="note">{html.escape(section.note)}</p>' if section.note else ""
    title = html.escape(section.title)
    return f"<section><h2>{title}</h2><table>{head}{rows}</table>{note}</section>"


def _row(row: tuple[str, ...], color: str) -> str:
    mark = f' class="numbered" style="border-left-color:{color}"' if color else ""
    first, *others = row
    # A number stays with its unit.
    cells = "".join(
        f"<td{_WHOLE if len(cell) <= _SHORT else ''}>{html.escape(cell)}</td>" for cell in others
    )
    return f"<tr><td{mark}>{html.escape(first)}</td>{cells}</tr>"
