"""Replays of plans as pages.

A door: what it names is made in `selfmotion.shell.replay`.
"""

from selfmotion.shell.replay import (
    check_pictures as check_pictures,
    figure as figure,
    meshcat_html as meshcat_html,
    notebook_html as notebook_html,
    render_gif as render_gif,
    render_png as render_png,
    replay_html as replay_html,
    write_meshcat as write_meshcat,
    write_replay as write_replay,
)
