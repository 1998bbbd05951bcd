"""Motions given by nodes on their self-motion manifolds, optimised by Newton's method."""

from selfmotion.nodes.batch import Batch as Batch
from selfmotion.nodes.motion import NodeGrid as NodeGrid, NodeMotion as NodeMotion
from selfmotion.nodes.newton import Optimum as Optimum, Step as Step, minimise as minimise
from selfmotion.nodes.smoothness import rest_times as rest_times
