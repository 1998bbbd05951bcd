"""A page that shows a plan while its problem is changed: handles, sliders, undo, save, export."""

from selfmotion.shell.view.edit_session import EditSession as EditSession
from selfmotion.shell.view.opening import opened as opened
from selfmotion.shell.view.page_session import PageSession as PageSession
from selfmotion.shell.view.server import (
    application as application,
    check_server as check_server,
    configuration as configuration,
    listening as listening,
    serve as serve,
)
