"""How far singular configurations are: clearance, crossings, trajectories, lines, guards."""
