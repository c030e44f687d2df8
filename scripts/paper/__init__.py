"""The tables and figures of Zhang, Fan, Wang, Cheng (2023), made again with pinsing."""
