"""q to J and sigma, one or millions."""
