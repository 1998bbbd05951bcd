"""A page that shows a plan while its problem is changed: handles, sliders, undo, save, export."""

from selfmotion.shell.view.opening import opened as opened
from selfmotion.shell.view.server import (
    application as application,
    check_server as check_server,
    configuration as configuration,
    listening as listening,
    serve as serve,
)
from selfmotion.shell.view.session import Session as Session
from selfmotion.shell.view.sitting import Sitting as Sitting
