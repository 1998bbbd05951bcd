"""Motions given by nodes on their self-motion manifolds, by an interior-point method."""

from selfmotion.planning.nodes.batch import Batch as Batch
from selfmotion.planning.nodes.motion import NodeGrid as NodeGrid, NodeMotion as NodeMotion
from selfmotion.planning.nodes.newton import Optimum as Optimum, Step as Step, minimise as minimise
from selfmotion.planning.nodes.smoothness import rest_times as rest_times
