"""The paper's method: joint sweeps over special angles."""
