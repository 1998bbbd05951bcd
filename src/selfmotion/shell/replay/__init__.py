"""The replay of a plan: one HTML file that needs no server, no network and no other file."""

from selfmotion.shell.replay.browser import (
    check_pictures as check_pictures,
    render_gif as render_gif,
    render_png as render_png,
)
from selfmotion.shell.replay.meshcat_page import (
    meshcat_html as meshcat_html,
    write_meshcat as write_meshcat,
)
from selfmotion.shell.replay.page import (
    notebook_html as notebook_html,
    replay_html as replay_html,
    write_replay as write_replay,
)
from selfmotion.shell.replay.still import figure as figure
