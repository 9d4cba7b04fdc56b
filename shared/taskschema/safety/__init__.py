"""What a motion of both arms must keep before it is made: limits, plan checks, and a sweep for distances.

The robot's gate makes these checks before every motion, simulation where a run asks for it. The collision
model and the sweep need the simulator's geometry, nothing else in this package does.
"""
