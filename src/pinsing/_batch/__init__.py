"""The compiled batch kernel: many configurations in, Jacobians or singular values out.

Pure data: it knows flattened chains (:class:`~pinsing.measures.Chain`) and arrays, no
robot library. The layer above checks it against Pinocchio before it is used.
"""
