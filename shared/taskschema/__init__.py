"""What every part of taskschema needs: tasks, skills, schema, policies, trajectories and the bus.

Imports no simulator, no torch and no Ray.
"""

__version__ = "0.1.0"
