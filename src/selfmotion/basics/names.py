"""Names that were probably meant."""

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(name: str, names: Iterable[str], alike: float = 0.5) -> str:
    """Return "; nearest: 'a', 'b'" with the names that are like `name`, "" where none is."""
    by_lower = {each.lower(): each for each in names}
    near = get_close_matches(str(name).lower(), by_lower, cutoff=alike)
    return f"; nearest: {', '.join(repr(by_lower[each]) for each in near)}" if near else ""
