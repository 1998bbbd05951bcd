"""Many problems at once: on the cores of this machine, or on a cluster."""

from selfmotion.work.batch.items import Item as Item, unread_item as unread_item
from selfmotion.work.batch.maps import labels as labels, maps as maps
from selfmotion.work.batch.rows import Row as Row
from selfmotion.work.batch.run import (
    Batch as Batch,
    BatchProgress as BatchProgress,
    plan_items as plan_items,
    plan_many as plan_many,
    processes as processes,
)
