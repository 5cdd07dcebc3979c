"""Finite elements of the displacement, one file each."""
