"""The replay of a plan: one HTML file that needs no server, no network and no other file."""

from selfmotion.shell.replay.browser import (
    check_pictures as check_pictures,
    render_gif as render_gif,
    render_png as render_png,
)
from selfmotion.shell.replay.content import plan_content as plan_content
from selfmotion.shell.replay.links import (
    GHOST as GHOST,
    ROBOT as ROBOT,
    joint_name as joint_name,
    safe as safe,
)
from selfmotion.shell.replay.meshcat_page import (
    meshcat_html as meshcat_html,
    write_meshcat as write_meshcat,
)
from selfmotion.shell.replay.meshes import Json as Json, Payload as Payload
from selfmotion.shell.replay.page import (
    live_html as live_html,
    notebook_html as notebook_html,
    replay_html as replay_html,
    write_replay as write_replay,
)
from selfmotion.shell.replay.redundancy import (
    MAX_SEAMS as MAX_SEAMS,
    SLICES as SLICES,
    SeamMaps as SeamMaps,
    slices as slices,
    tree as tree,
)
from selfmotion.shell.replay.replayed import PlanReplay as PlanReplay, Replayed as Replayed
from selfmotion.shell.replay.sequence import (
    Mark as Mark,
    SequenceReplay as SequenceReplay,
    seam_color as seam_color,
    stand_in as stand_in,
    unproved as unproved,
)
from selfmotion.shell.replay.still import figure as figure, picture as picture

__all__ = [
    "check_pictures",
    "figure",
    "meshcat_html",
    "notebook_html",
    "render_gif",
    "render_png",
    "replay_html",
    "write_meshcat",
    "write_replay",
]
