"""Find, state, prove and show the singular configurations of robot arms, on Pinocchio."""

__version__ = "0.1.0"
__all__ = ["__version__"]
