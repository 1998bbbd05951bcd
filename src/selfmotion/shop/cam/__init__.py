"""Tool motions from files: tables and lists of poses, G-code, APT, drawings."""

from selfmotion.shop.cam.cuts import (
    UNJUDGED as UNJUDGED,
)
from selfmotion.shop.cam.path_events import (
    times_of_events as times_of_events,
)
from selfmotion.shop.cam.path_files import (
    PATH_SUFFIXES as PATH_SUFFIXES,
    events_of as events_of,
    has_normals as has_normals,
    one_seam as one_seam,
    read_path as read_path,
    read_seams as read_seams,
)
from selfmotion.shop.cam.pose_rows import (
    Reading as Reading,
)
from selfmotion.shop.cam.ros_messages import (
    nanoseconds as nanoseconds,
)
