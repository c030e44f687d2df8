"""Robots: from a file, a name or a model to an Arm, and its nominal geometry."""
