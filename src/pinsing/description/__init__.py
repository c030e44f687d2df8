"""Robot files to checked text: URDF, xacro, DH tables, robots by name. No Pinocchio here."""
