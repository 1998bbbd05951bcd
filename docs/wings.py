"""Draw the wings of the house from the layers that `make lint` checks: ``python docs/wings.py``."""

import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "wings.svg"
PACKAGE = "selfmotion"
_WIDTH, _ROW, _GAP, _LABEL = 760, 40, 6, 130


def contracts() -> dict[str, list[list[str]]]:
    """Return the layers of each container, from the top; those beside each other are one list."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    return {
        container: [
            [name.strip("() ") for name in layer.replace(":", "|").split("|")]
            for layer in one["layers"]
        ]
        for one in tool["contracts"]
        if one["type"] == "layers"
        for container in one["containers"]
    }


def svg() -> str:
    """Return the picture: a row for each wing, its folders from the top, left to right."""
    layers = contracts()
    rows = [name for layer in layers[PACKAGE] for name in layer if name != "__main__"]
    doors = [name for layer in layers[PACKAGE] if len(layer) > 5 for name in layer]
    wings = [name for name in rows if name not in doors]
    lines = [("doors for users", ", ".join(f"sm.{name}" for name in doors[:6]) + ", …")]
    for wing in wings:
        inner = layers.get(f"{PACKAGE}.{wing}", [])
        lines.append((wing, " → ".join(" · ".join(layer) for layer in inner)))
    height = len(lines) * (_ROW + _GAP) + _GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        f'width="{_WIDTH}" height="{height}" font-family="sans-serif" font-size="14">',
        f'<rect width="{_WIDTH}" height="{height}" fill="white"/>',
    ]
    for k, (name, folders) in enumerate(lines):
        y = _GAP + k * (_ROW + _GAP)
        fill = "#e8eef7" if k else "#f5f0e4"
        parts += [
            f'<rect x="{_GAP}" y="{y}" width="{_WIDTH - 2 * _GAP}" height="{_ROW}" rx="5" '
            f'fill="{fill}" stroke="#8894a8"/>',
            f'<text x="{_GAP + 12}" y="{y + 25}" font-weight="bold">{escape(name)}</text>',
            f'<text x="{_LABEL + 24}" y="{y + 25}" fill="#333">{escape(folders)}</text>',
        ]
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    FILE.write_text(svg())
