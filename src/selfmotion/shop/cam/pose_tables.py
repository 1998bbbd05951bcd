"""Reader of tables of poses, with a seam for each name in a column."""

from collections.abc import Sequence
from pathlib import Path as FilePath

from selfmotion.basics import FileFormatError, read_rows
from selfmotion.shop.cam.column_names import EVENT, SEAM, column_name, kuka_titles, si_column
from selfmotion.shop.cam.pose_columns import rows_of_table
from selfmotion.shop.cam.pose_rows import PoseRows, Reading

# Columns of a table without a header, by their number.
_DEFAULT_HEADERS = {
    3: "x,y,z",
    4: "t,x,y,z",
    6: "x,y,z,nx,ny,nz",
    7: "x,y,z,qw,qx,qy,qz",
    8: "t,x,y,z,qw,qx,qy,qz",
}


def read_tables(file: FilePath, reading: Reading | None = None) -> dict[str, PoseRows]:
    """Return the rows of a table by the names in its column ``seam``, "" where it has none.

    Raises
    ------
    FileFormatError
        The table cannot be read as poses, or a row names no seam.
    """
    with_unit = set[str]()

    def read_title(title: str) -> str:
        """Return the name of a column by its title; note those whose title says a unit."""
        name = column_name(title)
        if "[" in title or "(" in title:
            with_unit.add(name)
        return name

    header, table, lines, texts = read_rows(
        file,
        (SEAM, EVENT),
        check=lambda names: [si_column(file, name) for name in kuka_titles(names)],
        columns=None if reading is None else reading.columns,
        named=read_title,
        usual=_DEFAULT_HEADERS,
    )
    labels = [f"line {number}" for number in lines]
    rows = rows_of_table(file, header, table, labels, texts, with_unit)
    if SEAM not in texts:
        return {"": rows}
    if not lines:
        raise FileFormatError(f"{file}: has 0 poses, expected at least two")
    seams = texts[SEAM]
    blank = next((line for line, seam in zip(lines, seams, strict=True) if not seam), None)
    if blank is not None:
        raise FileFormatError(f"{file}: line {blank}: names no seam")
    _check_rows_stand_together(file, seams, lines)
    return {
        seam: rows.selected([k for k, other in enumerate(seams) if other == seam])
        for seam in dict.fromkeys(seams)
    }


def _check_rows_stand_together(file: FilePath, seams: Sequence[str], lines: Sequence[int]) -> None:
    """Refuse a seam that goes on after rows of another one.

    Two tables that were put together may use a name twice; the tool would go from the one seam
    straight to the other.
    """
    ended = set[str]()
    for before, seam, line in zip(seams, seams[1:], lines[1:], strict=False):
        if seam != before:
            ended.add(before)
        if seam in ended:
            raise FileFormatError(
                f"{file}: line {line}: seam '{seam}' goes on after rows of seam '{before}', "
                f"expected its rows one after the other: give these rows a name of their own, or "
                f"put them behind the others of '{seam}'"
            )
