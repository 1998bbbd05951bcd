"""Cache of values that belong to layers of vertices."""

from typing import Generic, TypeVar

from selfmotion.basics import Array

Value = TypeVar("Value")


class LayerCache(Generic[Value]):
    """Values by layer, or by several layers, told apart by identity.

    Layers are kept alive with their values, so that no other array gets the id of one.

    Parameters
    ----------
    size : int
        Largest number of values. It bounds memory only: all are dropped when it is reached.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._entries: dict[tuple[int, ...], tuple[tuple[Array, ...], Value]] = {}

    def get(self, *layers: Array) -> Value | None:
        """Return the value of layers; None where there is none."""
        entry = self._entries.get(_key(layers))
        return None if entry is None else entry[1]

    def put(self, value: Value, *layers: Array) -> None:
        """Keep the value of layers."""
        if len(self._entries) >= self._size:
            self._entries.clear()
        self._entries[_key(layers)] = layers, value

    def emptied(self) -> "LayerCache[Value]":
        """Return an empty cache of the same size."""
        return LayerCache(self._size)


def _key(layers: tuple[Array, ...]) -> tuple[int, ...]:
    return tuple(id(layer) for layer in layers)
