"""Many problems at once: on the cores of this machine, or on a cluster."""

from selfmotion.batch.folder import Row
from selfmotion.batch.items import Item, grid_items
from selfmotion.batch.run import Batch, BatchProgress, plan_items, plan_many

__all__ = [
    "Batch",
    "BatchProgress",
    "Item",
    "Row",
    "grid_items",
    "plan_items",
    "plan_many",
]
