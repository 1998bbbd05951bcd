"""Handles of the page dragged by the mouse, in a browser."""

from typing import Any

import numpy as np

from support.views import Served

# How far the mouse goes [px].
PIXELS = 5.0
# So long a browser without a graphics card may take, and a job [ms].
PATIENCE = 120_000

# What of the scene moves when it is dragged: its mark, as the mouse has it.
GRAB = """(axis) => {
  const { controls, shown, name } = replay.live.handles;
  const { mark } = shown.get(name);
  viewer.scene.updateMatrixWorld(true);
  const box = viewer.renderer.domElement.getBoundingClientRect();
  const seen = (point) => {
    const { x, y } = point.clone().project(viewer.camera);
    return [box.left + (0.5 + x / 2) * box.width, box.top + (0.5 - y / 2) * box.height];
  };
  const at = new THREE.Vector3().setFromMatrixPosition(mark.matrixWorld);
  // The arrow of an axis ends at half of the control's size, which is the same on each screen.
  const high = 1.9 * Math.tan((Math.PI * viewer.camera.fov) / 360);
  const size = (at.distanceTo(viewer.camera.position) * high * controls.size) / 4;
  const ahead = (part) => at.clone().add(new THREE.Vector3().setComponent(axis, part * size));
  return [seen(ahead(0.35)), seen(ahead(0.45))];
}"""


def settled(page: Any, server: Served) -> Any:
    """Return the plan that is shown when all that was asked for is answered."""
    page.wait_for_function(
        """() => {
          const { asked, answered } = replay.live;
          const { live } = document.documentElement.dataset;
          return asked === answered && ["verified", "stopped"].includes(live);
        }""",
        timeout=PATIENCE,
    )
    return server.session.found.plan


def drag(page: Any, name: str, way: float) -> None:
    """Drag a handle by the mouse, by the arrow of x, there or back."""
    if page.locator(f"[data-handle='{name}']").get_attribute("aria-pressed") != "true":
        page.locator(f"[data-handle='{name}']").click()
    page.locator("#view").scroll_into_view_if_needed()
    (x, y), (ahead, below) = page.evaluate(GRAB, 0)
    along = np.array([ahead - x, below - y])
    along *= way * PIXELS / np.linalg.norm(along)
    page.mouse.move(x, y)
    page.mouse.down()
    for share in (0.3, 0.6, 1.0):
        page.mouse.move(*(np.array([x, y]) + share * along))
    page.mouse.up()


def turn(page: Any, name: str, angle: float) -> None:
    """Turn a handle by what its ring does when it is dragged [rad]."""
    page.evaluate(
        """([name, angle]) => {
          const { handles } = replay.live;
          handles.choose(name);
          const { mark } = handles.shown.get(name);
          handles.grip(true);
          mark.rotateZ(angle);
          handles.dragged();
          handles.grip(false);
        }""",
        [name, angle],
    )
