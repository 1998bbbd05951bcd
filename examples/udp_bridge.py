"""The loop on a transport: states come and segments go by UDP, here over loopback.

A bridge to ros2_control or libfranka is `Bridge`, with their messages in place of the datagrams:
what commands the arm keeps the last segment and takes one sample per cycle, so that a planner that
is late, or gone, leaves it with a motion that ends at rest.
"""

import socket
import threading

import numpy as np

import selfmotion as sm
from selfmotion import realtime

STEPS = 200


class Bridge:
    """Reads states [t, q, q̇] from a socket and writes segments [t, q, q̇, q̈ per cycle] to it."""

    def __init__(self, peer, path, dof):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(5.0)
        self._peer, self._path, self._dof = peer, path, dof
        self.address = self._socket.getsockname()

    def read(self):
        """Wait for the next state; an empty datagram ends the loop."""
        data = np.frombuffer(self._socket.recv(65536))
        if not len(data):
            return None
        return realtime.State(data[0], data[1 : 1 + self._dof], data[1 + self._dof :], self._path)

    def write(self, segment):
        """Send all samples, the stop at the end among them: some 350 of 7 joints at most."""
        rows = np.column_stack([segment.t, segment.q, segment.qd, segment.qdd])
        self._socket.sendto(rows.tobytes(), self._peer)

    def close(self):
        """Give the port back."""
        self._socket.close()


class FakeController(threading.Thread):
    """What stands for the arm: plays segments, and tells its state once a period."""

    def __init__(self, q, period):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(5.0)
        self.q, self.qd, self._period = q, np.zeros_like(q), period
        self.error, self.path, self.robot, self.planner = [], None, None, None

    def run(self):
        """Tell the state, take the segment, play a period of it."""
        n = len(self.q)
        for step in range(STEPS):
            t = step * self._period
            self.socket.sendto(np.concatenate([[t], self.q, self.qd]).tobytes(), self.planner)
            rows = np.frombuffer(self.socket.recv(65536)).reshape(-1, 1 + 3 * n)
            now = rows[np.argmin(np.abs(rows[:, 0] - t - self._period))]
            self.q, self.qd = now[1 : 1 + n].copy(), now[1 + n : 1 + 2 * n].copy()
            target = self.path.pose(t + self._period).translation
            self.error.append(np.linalg.norm(self.robot.pose(self.q).translation - target))
        self.socket.sendto(b"", self.planner)
        self.socket.close()


panda = sm.load_robot("panda")
start = np.array(sm.NAMED_ARMS["panda"].home)
path = sm.paths.Circle.around(panda.pose(start), 0.1, 10.0, normal=(1, 0, 0))
replanner = realtime.Replanner(panda, "pose")
realtime.warm_up(replanner)
controller = FakeController(start, replanner.period)
bridge = Bridge(controller.socket.getsockname(), path, panda.dof)
controller.path, controller.robot, controller.planner = path, panda, bridge.address
controller.start()
count = realtime.follow(replanner, bridge.read, bridge.write)
controller.join()
bridge.close()
print(f"{count} segments by UDP; the tool was off its path by at most "
      f"{1e6 * max(controller.error):.2f} µm")  # fmt: skip
