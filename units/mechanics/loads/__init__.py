"""Loads: what deforms the solid, one file each."""
