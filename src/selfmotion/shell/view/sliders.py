"""Numbers of a document that are set by sliders: feed, clearance, tolerances, weights of costs."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from selfmotion.shell.replay import Json
from selfmotion.shell.view.document import Keys, at

# A slider goes from a part of its number to a multiple; where it begins at 0, to this [m].
_SPAN, _CLEARANCES = 8.0, 0.1
# Keys of sections: what their sliders are called, and in which unit.
_OF_PATH = {
    "feed": ("feed", "m/s"),
    "feed_mm": ("feed", "mm/s"),
    "duration": ("duration", "s"),
}
_OF_TOLERANCE = {
    "position": ("tolerance of position", "m"),
    "position_mm": ("tolerance of position", "mm"),
    "rotation": ("tolerance of rotation", "rad"),
    "rotation_deg": ("tolerance of rotation", "°"),
}
# Of more seams none has a slider of its own.
_MAX_SEAMS = 12
_WEIGHTS = ("weight", "mu")
# Of more bodies none has a slider of its own.
_MAX_BODIES = 8


@dataclass(frozen=True)
class Slider:
    """A number with the range in which it is slid.

    Attributes
    ----------
    name : str
    keys : tuple
        The way to it in the document.
    value, low, high : float
        In the document's unit.
    unit : str
    even : bool
        Whether equal ways of the slider are equal differences, rather than equal factors.
    """

    name: str
    keys: Keys
    value: float
    low: float
    high: float
    unit: str
    even: bool = False

    @property
    def json(self) -> Json:
        """What the page has to know."""
        return {
            "name": self.name,
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "unit": self.unit,
            "even": self.even,
        }


def sliders_of(document: Mapping[str, Any], begun: Mapping[str, Any]) -> dict[str, Slider]:
    """Return the sliders of a document by name, with ranges about what it `begun` with."""
    return {slider.name: slider for slider in _sliders(document, begun)}


def _sliders(document: Mapping[str, Any], begun: Mapping[str, Any]) -> Iterator[Slider]:
    for keys, of in _paced(document):
        for key, (name, unit) in _OF_PATH.items():
            yield from _about(document, begun, (*keys, key), f"{name}{of}", unit)
    yield from _clearance(document, begun)
    for key, (name, unit) in _OF_TOLERANCE.items():
        yield from _about(document, begun, ("tolerance", key), name, unit)
    for k, item in enumerate(document.get("relaxations", [])):
        rows = item.get("rows", "")
        name = f"band of {rows if isinstance(rows, str) else ', '.join(rows)}"
        for key, unit in (("band", ""), ("band_mm", "mm"), ("band_deg", "°")):
            yield from _about(document, begun, ("relaxations", k, key), name, unit)
    for k, item in enumerate(document.get("costs", [])):
        name = f"weight of {item.get('name', item['kind'])}"
        for key in _WEIGHTS:
            yield from _about(document, begun, ("costs", k, key), name, "")


def _paced(document: Mapping[str, Any]) -> Iterator[tuple[Keys, str]]:
    """Return the tables that say how fast a path is, and how their sliders are told apart."""
    seams = document.get("seams")
    if isinstance(seams, list):
        if len(seams) <= _MAX_SEAMS:
            yield from (
                (("seams", k, "path"), f" of {seams[k]['name']}") for k in range(len(seams))
            )
    else:
        yield ("path",) if seams is None else ("seams",), ""


def _about(
    document: Mapping[str, Any], begun: Mapping[str, Any], keys: Keys, name: str, unit: str
) -> Iterator[Slider]:
    value, first = at(document, keys), at(begun, keys)
    first = value if not _is_number(first) else first
    if _is_number(value) and value > 0.0 and first > 0.0:
        low, high = min(first / _SPAN, value), max(first * _SPAN, value)
        yield Slider(name, keys, float(value), low, high, unit)


def _clearance(document: Mapping[str, Any], begun: Mapping[str, Any]) -> Iterator[Slider]:
    """Return a slider for each distance that bodies keep."""
    tables: list[Keys] = [
        ("constraints", k)
        for k, item in enumerate(document.get("constraints", []))
        if item.get("kind") == "Clearance"
    ]
    # Without one of its own a problem keeps the arm off itself, unless it says false.
    given = document.get("clearance", {})
    if isinstance(given, list):
        tables += [("clearance", k) for k in range(len(given))]
    elif not tables and isinstance(given, Mapping):
        tables = [("clearance",)]
    for number, keys in enumerate(tables, start=1):
        only = at(document, (*keys, "only"))
        name = "clearance" if len(tables) == 1 else f"clearance {number}"
        name = f"clearance from {', '.join(only)}" if only else name
        key = "distance_mm" if at(document, (*keys, "distance_mm")) is not None else "distance"
        unit, most = ("mm", 1e3 * _CLEARANCES) if key.endswith("_mm") else ("m", _CLEARANCES)
        value = at(document, (*keys, key))
        value = float(value) if _is_number(value) else 0.0
        first = at(begun, (*keys, key))
        high = max(most, 2.0 * value, 2.0 * first if _is_number(first) else 0.0)
        yield Slider(name, (*keys, key), value, 0.0, high, unit, even=True)
        # Those of the workpiece are kept clear of as the first clearance says.
        places = [keys, *([("workpiece",)] if number == 1 else [])]
        bodies = [(*way, "obstacles", k) for way in places for k in range(_count(document, way))]
        for body in bodies if len(bodies) <= _MAX_BODIES and not only else ():
            yield _from_body(document, body, value if unit == "mm" else 1e3 * value)


def _count(document: Mapping[str, Any], keys: Keys) -> int:
    """Return how many obstacles a table has."""
    return len(at(document, (*keys, "obstacles")) or ())


def _from_body(document: Mapping[str, Any], keys: Keys, usual: float) -> Slider:
    """Return the slider of the distance from one body; by default that of its clearance [mm]."""
    body = at(document, keys)
    key = "distance" if "distance" in body else "distance_mm"
    scale = 1e-3 if key == "distance" else 1.0
    value = float(body.get(key, scale * usual))
    high = max(1e3 * scale * _CLEARANCES, 2.0 * value)
    unit = "m" if key == "distance" else "mm"
    return Slider(f"clearance from {body['name']}", (*keys, key), value, 0.0, high, unit, even=True)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
