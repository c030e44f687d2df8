"""Polynomials over Q, Q(sqrt 2, sqrt 3) and finite fields, their zeros and matrices of them."""
